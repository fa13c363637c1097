"""The election in the cases that people ask about, and under faults of every kind in virtual time."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule

from protocol import election, state_diagrams
from protocol.ballot import CAUTION, CLOCK_DRIFT
from protocol.core import Heard, Note, Persist, Say, Tick, WakeAt, Written
from protocol.election import (
    LARGEST_LEAP,
    LEASE_S,
    REST_AFTER_FAILURE_S,
    Effect,
    Election,
    Event,
    Leads,
    LeadsNoMore,
)
from protocol.election_states import TRANSITIONS, Occurrence, Standing
from protocol.messages import Authority, Envelope, LastHeard, Reign, Vote, VoteRequest, Warrant, decode, encode
from protocol.obedience import Obedience, Obeys, ObeysNobody
from protocol.promises import decode_promise
from protocol.roster import Roster
from tests.protocol.election_team import Peer, Team

THREE = Roster(("base", "robot1", "robot2"), ("agent",))


def peer(name: str = "robot1", promise: Reign | None = None, now_s: float = -2.0, incarnation: int = 0) -> Election:
    return Election(THREE, team="t", name=name, incarnation=incarnation, promise=promise, seed=1, now_s=now_s)


def request(epoch: int = 1, correlation: str = "0.1", warrant: Warrant | None = None) -> VoteRequest:
    return VoteRequest(epoch=epoch, correlation=correlation, warrant=warrant)


def asked(voter: Election, now_s: float, body: VoteRequest, by: str = "base", disk: str = "") -> list[Effect]:
    """Effects of a request, when the disk has done what it was asked to."""
    effects = voter.handle(Heard(by, 0, body), now_s)
    for effect in effects:
        if isinstance(effect, Persist):
            effects = [*effects, *voter.handle(Written(effect.token, disk), now_s)]
    return effects


def votes(effects: list[Effect]) -> list[Vote]:
    return [effect.body for effect in effects if isinstance(effect, Say) and isinstance(effect.body, Vote)]


def reign(epoch: int, leader: str = "base", incarnation: int = 0) -> Reign:
    return Reign(epoch=epoch, leader=leader, incarnation=incarnation)


def test_a_promise_is_on_disk_before_it_is_said() -> None:
    voter = peer()
    effects = voter.handle(Heard("base", 0, request(5)), 0.0)
    assert votes(effects) == []
    (persist,) = (effect for effect in effects if isinstance(effect, Persist))
    assert decode_promise(persist.content, file="", team="t", voter="robot1", incarnation=1) == reign(5)
    assert votes(asked(voter, 0.0, request(6, "0.9"), by="robot2"))[0].granted is False, "while it is being written"
    assert voter.handle(Written(persist.token + 1), 0.0)[:-1] == [], "some other write"
    (vote,) = votes(voter.handle(Written(persist.token), 0.1))
    assert vote.granted
    assert vote.promise == reign(5)
    assert (vote.candidate, vote.correlation) == ("base", "0.1")


def test_a_running_promise_is_renewed_without_the_disk_and_refused_to_others() -> None:
    voter = peer()
    asked(voter, 0.0, request(5))
    effects = asked(voter, 0.9, request(5, "0.2"))
    assert votes(effects)[0].granted
    assert not any(isinstance(effect, Persist) for effect in effects)
    for now_s, granted in ((1.8, False), (1.91, True)):
        (vote,) = votes(asked(voter, now_s, request(6, "0.7"), by="robot2"))
        assert vote.granted is granted
    (vote,) = votes(asked(voter, 9.0, request(5, "0.3")))
    assert not vote.granted, "an earlier epoch"
    assert vote.promise == reign(6, "robot2")


def test_a_restarted_voter_promises_nothing_for_one_lease() -> None:
    voter = peer(promise=reign(5), now_s=10.0, incarnation=1)
    for body in (request(5), request(6)):
        assert not votes(asked(voter, 10.99, body))[0].granted
    assert votes(asked(voter, 11.0, request(5)))[0].granted


def test_a_restarted_leader_is_another_leader() -> None:
    voter = peer()
    asked(voter, 0.0, request(5))
    again = voter.handle(Heard("base", 1, request(5, "1.1")), 0.5)
    assert not votes(again)[0].granted
    assert votes(again)[0].promise == reign(5)


def test_epochs_that_leap_are_damage() -> None:
    voter = peer()
    assert asked(voter, 0.0, request(LARGEST_LEAP + 1))[:-1] == []
    assert votes(asked(voter, 0.0, request(LARGEST_LEAP)))[0].granted


def test_a_full_disk_costs_the_vote_and_one_sentence() -> None:
    voter, said, now_s = peer(), [], 0.0
    for _ in range(3):
        effects = asked(voter, now_s, request(5), disk="No space left on device")
        assert not any(vote.granted for vote in votes(effects))
        assert voter.standing is Standing.RESTING
        said += [effect.text for effect in effects if isinstance(effect, Note)]
        assert not votes(asked(voter, now_s + 0.1, request(5), disk="No space left on device"))[0].granted
        now_s += REST_AFTER_FAILURE_S
    assert len(said) == 1
    assert re.search("robot1 does not vote.*No space left on device.*make room", said[0])
    assert votes(asked(voter, now_s, request(5)))[0].granted, "room has been made"


def candidate_with_votes(now_s: float = 0.1) -> tuple[Election, Persist]:
    """The base station as a candidate whose own vote, which would make it the leader, is being written."""
    base = peer("base")
    base.handle(Tick(), 0.0)
    (canvass,) = requests(base.handle(Tick(), now_s))
    assert canvass.canvass
    (asking,) = requests(base.handle(Heard("robot1", 0, vote_for(canvass, promise=None)), now_s))
    assert not asking.canvass
    effects = base.handle(Heard("robot1", 0, vote_for(asking, promise=reign(asking.epoch))), now_s)
    (persist,) = (effect for effect in effects if isinstance(effect, Persist))
    return base, persist


def requests(effects: list[Effect]) -> list[VoteRequest]:
    return [effect.body for effect in effects if isinstance(effect, Say) and isinstance(effect.body, VoteRequest)]


def vote_for(asking: VoteRequest, promise: Reign | None) -> Vote:
    return Vote(candidate="base", correlation=asking.correlation, granted=True, promise=promise, mark="0.1")


def test_a_leader_leads_from_when_its_own_vote_is_on_disk_and_for_no_longer_than_its_lease() -> None:
    base, persist = candidate_with_votes(now_s=0.1)
    assert not base.leads(0.1)
    assert base.warrant(0.1) is None
    effects = base.handle(Written(persist.token), 0.15)
    assert [type(effect) for effect in effects] == [Leads, Say, Obeys, WakeAt]
    assert base.leads(0.999)
    assert not base.leads(1.0), "0.9 s from when it asked"
    warrant = base.warrant(0.5)
    assert warrant is not None
    assert warrant.lease_s == pytest.approx(0.5)
    assert {heard.peer for heard in warrant.marks} == {"base", "robot1"}
    base.handle(Tick(), 0.9)
    effects = base.handle(Tick(), 1.0)
    assert [type(effect) for effect in effects] == [LeadsNoMore, ObeysNobody, WakeAt]
    assert base.warrant(1.0) is None


def test_the_answers_to_a_canvass_are_no_votes() -> None:
    base = peer("base")
    base.handle(Tick(), 0.0)
    (canvass,) = requests(base.handle(Tick(), 0.1))
    (asking,) = requests(base.handle(Heard("robot1", 0, vote_for(canvass, promise=reign(1))), 0.1))
    for name in ("robot1", "robot2"):
        assert base.handle(Heard(name, 0, vote_for(canvass, promise=reign(1))), 0.1)[:-1] == []
    assert base.standing is Standing.CANDIDATE
    assert not base.leads(0.1)
    assert any(isinstance(e, Persist) for e in base.handle(Heard("robot2", 0, vote_for(asking, reign(1))), 0.1))


def test_a_canvass_binds_nobody() -> None:
    voter = peer()
    canvass = VoteRequest(epoch=5, correlation="0.1", canvass=True)
    for name in ("base", "robot2"):
        (vote,) = votes(asked(voter, 0.0, canvass, by=name))
        assert vote.granted
        assert vote.promise is None
    assert votes(asked(voter, 0.0, request(1)))[0].granted
    assert not votes(asked(voter, 0.1, canvass, by="robot2"))[0].granted, "its promise is running"


def test_a_candidate_whose_disk_is_full_gives_back_what_it_was_promised() -> None:
    base, persist = candidate_with_votes()
    effects = base.handle(Written(persist.token, "Read-only file system"), 0.1)
    assert [asking.withdrawn for asking in requests(effects)] == [True]
    assert not base.leads(0.1)


def test_who_has_no_vote_answers_with_a_mark_and_obeys() -> None:
    agent = peer("agent")
    (vote,) = votes(asked(agent, 5.0, request(3)))
    assert not vote.granted
    warrant = Warrant(lease_s=0.5 / CAUTION, marks=(LastHeard(peer="agent", mark=vote.mark),))
    effects = asked(agent, 5.2, request(3, "0.2", warrant))
    assert Obeys(reign(3)) in effects
    assert votes(effects)[0].promise is None
    assert effects[-1] == WakeAt(5.5)
    effects = agent.handle(Tick(), 5.5)
    assert [type(effect) for effect in effects] == [ObeysNobody, WakeAt]
    assert effects[-1] == WakeAt(math.inf)
    assert votes(asked(agent, 6.0, request(2)))[0].promise == reign(3), "so that leaders take a higher epoch"


def obedient(now_s: float = 0.0) -> tuple[Election, str]:
    """A robot that has promised the base its vote, and the mark that it said with it."""
    robot = peer()
    (vote,) = votes(asked(robot, now_s, request(5)))
    return robot, vote.mark


def order(mark: str, lease_s: float = 0.6 / CAUTION, sequence: int = 1, epoch: int = 5) -> tuple[Authority, Warrant]:
    authority = Authority(epoch=epoch, leader="base", sequence=sequence)
    return authority, Warrant(lease_s=lease_s, marks=(LastHeard(peer="robot1", mark=mark),))


def test_an_order_runs_out_by_the_clock_of_who_obeys_counted_from_its_mark() -> None:
    robot, mark = obedient(now_s=100.0)
    authority, warrant = order(mark)
    assert robot.obedience.take("deployment", authority, reign(5), warrant, 100.5) == ""
    assert robot.obedience.obeyed(100.59) == reign(5)
    assert robot.obedience.obeyed(100.61) is None
    authority, warrant = order(mark, sequence=2)
    assert robot.obedience.take("deployment", authority, reign(5), warrant, 100.61).startswith("stale")
    authority, warrant = order(mark, lease_s=1e9, sequence=2)
    assert robot.obedience.take("deployment", authority, reign(5), warrant, 100.89) == ""
    assert robot.obedience.obeyed(100.91) is None, "nobody holds a lease for longer than a lease"


def test_a_mark_that_the_leader_has_had_for_a_while_makes_an_order_last() -> None:
    for age_s, until_s in ((0.0, 100.36), (0.01, 100.369), (0.4, 100.72), (9.0, 100.9)):
        robot, mark = obedient(now_s=100.0)
        heard = (LastHeard(peer="robot1", mark=mark, age_s=age_s),)
        authority, _ = order(mark)
        assert robot.obedience.take("deployment", authority, reign(5), Warrant(lease_s=0.4, marks=heard), 100.1) == ""
        assert robot.obedience.until_s == pytest.approx(until_s), age_s


def test_a_leader_says_how_long_ago_it_heard_a_mark() -> None:
    base, persist = candidate_with_votes(now_s=0.1)
    base.handle(Written(persist.token), 0.15)
    base.handle(Heard("robot2", 0, Vote(candidate="base", correlation="0.9", granted=False, mark="0.7")), 0.2)
    warrant = base.warrant(0.5)
    assert warrant is not None
    ages = {(heard.peer, heard.mark): heard.age_s for heard in warrant.marks}
    own = next(mark for name, mark in ages if name == "base")
    assert ages == pytest.approx({("base", own): 0.0, ("robot1", "0.1"): 0.4, ("robot2", "0.7"): 0.3})


DRIFTS = st.sampled_from([1.0 - CLOCK_DRIFT, 1.0, 1.0 + CLOCK_DRIFT])


@given(st.floats(-2.0, 0.9), st.floats(0.0, 2.0), st.floats(0.0, 2.0), DRIFTS, DRIFTS)
def test_nobody_obeys_when_the_lease_has_ended_that_an_order_was_given_in(
    said_s: float, heard_after_s: float, given_after_s: float, leader: float, hearer: float
) -> None:
    """By true time, since a majority was asked that voted after that: it is bound for a lease by its fastest clock."""
    given_s = said_s + heard_after_s + given_after_s
    lease_s = CAUTION * LEASE_S - leader * given_s
    assume(given_s >= 0.0 and lease_s > 0.0)
    obedience = Obedience("robot1", 0, LEASE_S, None)
    age_s = leader * given_after_s
    heard = LastHeard(peer="robot1", mark=obedience.mark(hearer * said_s), age_s=age_s)
    obedience.heed(reign(1), Warrant(lease_s=lease_s, marks=(heard,)), hearer * said_s)
    assert obedience.until_s / hearer <= CAUTION * LEASE_S / leader + 1e-9
    assert CAUTION * LEASE_S / leader <= LEASE_S / (1.0 + CLOCK_DRIFT)


def test_orders_that_are_not_taken() -> None:
    robot, mark = obedient()
    take = robot.obedience.take
    assert take("deployment", *order_of(order(mark, sequence=4)), 0.1) == ""
    assert take("deployment", *order_of(order(mark, sequence=4)), 0.1) == "older than an order taken before"
    assert take("topology", *order_of(order(mark, sequence=3)), 0.1) == "", "kinds may overtake each other"
    assert take("deployment", *order_of(order("0.999", sequence=5)), 0.1).startswith("stale")
    assert take("deployment", *order_of(order(mark, sequence=5, epoch=6)), 0.1).startswith(
        "of a leader that it has not"
    )
    authority, warrant = order(mark, sequence=5)
    assert take("deployment", authority, reign(5, "robot2"), warrant, 0.1) == "of another leader than it names"
    assert take("deployment", authority, reign(5, incarnation=1), warrant, 0.1).startswith(
        "of a leader that it has not"
    )
    other = Warrant(lease_s=0.6, marks=(LastHeard(peer="robot2", mark=mark),))
    assert take("deployment", authority, reign(5), other, 0.1).startswith("stale"), (
        "it brings back nothing of this robot"
    )


def order_of(parts: tuple[Authority, Warrant]) -> tuple[Authority, Reign, Warrant]:
    authority, warrant = parts
    return authority, reign(authority.epoch, authority.leader), warrant


def test_a_restarted_robot_knows_no_mark_of_before() -> None:
    _, mark = obedient(now_s=0.0)
    robot = peer(promise=reign(5), now_s=0.1, incarnation=1)
    assert robot.obedience.take("deployment", *order_of(order(mark)), 0.2).startswith("stale")


def test_marks_do_not_fill_the_memory() -> None:
    robot = peer()
    said = {vote.mark for i in range(5_000) for vote in votes(asked(robot, i * 4e-4, request(5, f"0.{i}")))}
    assert 150 <= len(said) <= 210
    assert len(robot.obedience._said_s) <= 100


def test_memory_is_bounded_whatever_arrives() -> None:
    leader = led(Team(3, 0)).mind
    assert leader is not None
    now_s = 1e7
    for i in range(1000):
        vote = Vote(candidate="base", correlation=f"0.{i}", granted=True, promise=reign(i), mark=f"9.{i}")
        leader.handle(Heard(f"robot{i % 50}", i, vote), now_s + i * 0.01)
        leader.handle(Heard("robot1", i, request(i)), now_s + i * 0.01)
    assert len(leader._marks) <= 3
    ballot = leader._ballot
    assert ballot is None or len(ballot._asked_s) <= 10


EPOCHS = st.one_of(st.integers(0, 4), st.integers(0, 2**53 - 1))
NAMES = st.sampled_from(["base", "robot1", "robot2", "agent", "robot9"])
NUMBERS = st.sampled_from([f"{incarnation}.{number}" for incarnation in (0, 1) for number in range(6)])
REIGNS = st.builds(Reign, epoch=EPOCHS, leader=NAMES, incarnation=st.integers(0, 1))
WARRANTS = st.builds(
    Warrant,
    lease_s=st.floats(0.0, 1e300),
    marks=st.lists(st.builds(LastHeard, peer=NAMES, mark=NUMBERS), max_size=4).map(tuple),
)
ANYTHING = st.one_of(
    st.just(Tick()),
    st.builds(Written, st.integers(0, 4), st.sampled_from(["", "", "No space left on device"])),
    st.builds(
        Heard,
        NAMES,
        st.integers(0, 1),
        st.one_of(
            st.builds(
                VoteRequest,
                epoch=EPOCHS,
                correlation=NUMBERS,
                warrant=st.none() | WARRANTS,
                canvass=st.booleans(),
                withdrawn=st.booleans(),
            ),
            st.builds(
                Vote,
                candidate=NAMES,
                correlation=NUMBERS,
                granted=st.booleans(),
                promise=st.none() | REIGNS,
                mark=NUMBERS,
            ),
        ),
    ),
)


@given(
    NAMES.filter("robot9".__ne__), st.lists(st.tuples(st.sampled_from([0.0, 0.01, 0.3, 2.0]), ANYTHING), max_size=60)
)
def test_nothing_that_arrives_breaks_a_peer_or_its_rules(name: str, events: list[tuple[float, Event]]) -> None:
    mind, now_s = peer(name), 0.0
    bound: tuple[tuple[str, int], float] | None = None
    """To whom it has promised its vote, and until when."""
    for wait_s, event in events:
        now_s += wait_s
        effects = mind.handle(event, now_s)
        assert isinstance(effects[-1], WakeAt)
        for effect in effects:
            if isinstance(effect, Say):
                message = Envelope(sender=name, incarnation=0, sequence=0, sent_at_s=0.0, body=effect.body)
                assert decode(encode(message)) == message
        for vote in votes(effects):
            if vote.granted and vote.promise is not None and not is_canvass(event):
                holder = (vote.promise.leader, vote.promise.incarnation)
                assert bound is None or holder == bound[0] or now_s >= bound[1]
                bound = (holder, now_s + LEASE_S)
        if isinstance(event, Heard) and isinstance(event.body, VoteRequest) and event.body.withdrawn:
            bound = None


def is_canvass(event: Event) -> bool:
    return isinstance(event, Heard) and isinstance(event.body, VoteRequest) and event.body.canvass


def led(team: Team) -> Peer:
    """The leader that a team has after a while."""
    team.run(2.0)
    (leader,) = team.leaders()
    return leader


@pytest.mark.parametrize(
    "name",
    ["core", "roster", "promises", "voter", "ballot", "obedience", "election_states", "election", "membership"],
)
def test_the_cores_know_no_clock_thread_file_or_socket(name: str) -> None:
    source = (Path(election.__file__).parent / f"{name}.py").read_text(encoding="utf-8")
    imported = {line.split()[1].partition(".")[0] for line in source.splitlines() if re.match("(import|from) ", line)}
    assert "__future__" in imported
    assert imported.isdisjoint({"time", "datetime", "os", "pathlib", "io", "threading", "asyncio", "socket", "zenoh"})


def test_the_table_names_every_state_and_reaches_each() -> None:
    assert set(TRANSITIONS) == set(Standing)
    reached, frontier = {Standing.RESTING}, [Standing.RESTING]
    while frontier:
        for after in TRANSITIONS[frontier.pop()].values():
            if after not in reached:
                reached.add(after)
                frontier.append(after)
    assert reached == set(Standing) - {Standing.OBSERVING}
    assert {occurrence for row in TRANSITIONS.values() for occurrence in row} == set(Occurrence)


@pytest.mark.parametrize("page", state_diagrams.PAGES, ids=lambda page: page.name)
def test_the_diagrams_in_the_documents_are_made_from_the_tables(page: state_diagrams.Page) -> None:
    text = page.file.read_text(encoding="utf-8")
    assert text == state_diagrams.with_diagram(page, text), (
        "run `python -m protocol.state_diagrams` and commit the result"
    )


@pytest.mark.parametrize("seed", range(4))
def test_the_base_station_leads_and_when_it_dies_a_robot_does(seed: int) -> None:
    team = Team(5, seed)
    team.run(1.6)
    assert [leader.name for leader in team.leaders()] == [team.reigns[-1][1].leader]
    died_s = team.time.now_s
    team.kill(team.leaders()[0].name)
    team.run(1.5)
    (began_s, new), *others = [(time_s, reign) for time_s, reign in team.reigns if time_s > died_s]
    assert others == []
    assert began_s - died_s < 1.3 * LEASE_S
    alive = [name for name, peer in team.peers.items() if peer.mind is not None]
    assert {team.obeys(name) for name in alive} == {new}
    assert team.taken > 15
    old = team.reigns[0][1].leader
    team.start(old)
    team.run(3.0)
    assert team.reigns[-1][1] == new, "who comes back does not push out who leads"
    assert team.obeys(old) == new


def test_mostly_the_base_station_is_elected_first() -> None:
    first = []
    for seed in range(12):
        team = Team(4, seed)
        team.run(1.3)
        first.append(team.reigns[0][1].leader)
    assert first.count("base") >= 8


def test_a_leader_that_hangs_is_replaced_and_steps_down_when_it_goes_on() -> None:
    team = Team(3, 3)
    old = led(team).name
    team.pause(old)
    team.run(1.6)
    (new,) = team.leaders()
    assert new.name != old
    team.resume(old)
    assert [leader.name for leader in team.leaders()] == [new.name]
    assert team.peers[old].mind.office is None  # type: ignore[union-attr]
    team.run(0.5)
    assert team.obeys(old) == new.mind.office  # type: ignore[union-attr]


def test_the_minority_holds_and_follows_again_when_it_is_healed() -> None:
    team = Team(5, 1)
    led(team)
    team.part({"base", "robot1"})
    team.run(2.5)
    (leader,) = team.leaders()
    assert leader.name not in ("base", "robot1")
    assert team.obeys("base") is team.obeys("robot1") is None
    team.run(20.0)
    disks = [peer.disk for peer in team.peers.values()]
    team.heal()
    team.run(1.0)
    assert {team.obeys(name) for name in team.peers} == {leader.mind.office}  # type: ignore[union-attr]
    assert [peer.disk for peer in team.peers.values()][2:5] == disks[2:5], "the majority was not disturbed"


def test_halves_hold() -> None:
    team = Team(4, 2)
    led(team)
    team.part({"base", "robot1", "agent"})
    team.run(2.5)
    assert team.leaders() == []
    assert [team.obeys(name) for name in team.peers] == [None] * 5
    team.heal()
    team.run(1.5)
    assert len(team.leaders()) == 1


def test_a_leader_takes_a_higher_epoch_for_a_voter_that_has_promised_one() -> None:
    team = Team(3, 1)
    leader = led(team)
    straggler = next(name for name in team.roster.voters if name != leader.name)
    mind = team.peers[straggler].mind
    assert mind is not None
    mind._voter.promise = reign(40, straggler)
    mind._voter.runs_until_s = -math.inf
    team.run(0.5)
    assert team.leaders() == [leader], "without an interruption"
    (before, now) = [began for _, began in team.reigns[-2:]]
    assert (now.leader, now.epoch) == (before.leader, 41)
    assert team.obeys(straggler) == now


def test_a_third_of_all_messages_lost_costs_no_reign() -> None:
    team = Team(5, 0)
    team.loss = 0.3
    team.run(30.0)
    assert len(team.reigns) <= 2
    held = sum(team.obeys(name) is not None for _ in range(40) if team.run(0.25) is None for name in team.peers)  # type: ignore[func-returns-value]
    assert held / (40 * 6) > 0.95


class Faults(RuleBasedStateMachine):
    """Any faults in any order break no rule; when they stop, one leads within three leases and all obey it."""

    @initialize(voters=st.sampled_from([3, 4, 5]), seed=st.integers(0, 2**16))
    def begin(self, voters: int, seed: int) -> None:
        self.team = Team(voters, seed)
        self.team.run(1.5)

    @rule(seconds=st.sampled_from([0.01, 0.3, 1.1]))
    def wait(self, seconds: float) -> None:
        self.team.run(seconds)

    @rule(number=st.integers(0, 5), lose_disk=st.booleans(), seconds=st.sampled_from([0.0, 0.2]))
    def kill(self, number: int, lose_disk: bool, seconds: float) -> None:
        self.team.kill(self._name(number), lose_disk)
        self.team.run(seconds)

    @rule(number=st.integers(0, 5), seconds=st.sampled_from([0.0, 0.2]))
    def start(self, number: int, seconds: float) -> None:
        self.team.start(self._name(number))
        self.team.run(seconds)

    @rule(number=st.integers(0, 5), seconds=st.sampled_from([0.1, 1.2]))
    def stop(self, number: int, seconds: float) -> None:
        self.team.pause(self._name(number))
        self.team.run(seconds)

    @rule(number=st.integers(0, 5), seconds=st.sampled_from([0.0, 0.2]))
    def go_on(self, number: int, seconds: float) -> None:
        self.team.resume(self._name(number))
        self.team.run(seconds)

    @rule(numbers=st.sets(st.integers(0, 5), min_size=1), seconds=st.sampled_from([0.2, 1.2]))
    def part(self, numbers: set[int], seconds: float) -> None:
        self.team.part({self._name(number) for number in numbers})
        self.team.run(seconds)

    @rule(pair=st.tuples(st.integers(0, 5), st.integers(0, 5)), seconds=st.sampled_from([0.2, 1.2]))
    def cut_one_way(self, pair: tuple[int, int], seconds: float) -> None:
        self.team.cut.add((self._name(pair[0]), self._name(pair[1])))
        self.team.run(seconds)

    @rule(
        loss=st.sampled_from([0.0, 0.3, 0.7]),
        delay_s=st.sampled_from([0.005, 0.3, 2.5]),
        disk_s=st.sampled_from([0.005, 1.5]),
    )
    def worsen(self, loss: float, delay_s: float, disk_s: float) -> None:
        self.team.loss, self.team.delay_s, self.team.disk_s = loss, (0.0, delay_s), (0.0, disk_s)
        self.team.run(0.4)

    def _name(self, number: int) -> str:
        names = self.team.roster.names
        return names[number % len(names)]

    def teardown(self) -> None:
        if not hasattr(self, "team"):
            return
        team = self.team
        team.heal()
        team.run(3.0 * LEASE_S)
        (leader,) = team.leaders()
        assert {team.obeys(name) for name in team.peers} == {team.reigns[-1][1]}
        assert team.reigns[-1][1].leader == leader.name


TestFaults = Faults.TestCase
TestFaults.settings = settings(max_examples=12, stateful_step_count=20, deadline=None)

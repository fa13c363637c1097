"""The team's tree, as every peer with a vote keeps it: what is in force, what is proposed, and what it says of that.

The negotiation itself is :mod:`protocol.negotiation` (the leader's side) and :mod:`protocol.held_tree` (everybody's).
Here they are joined to a mind: words that are not in force are not heard, links are judged by what this peer knows
itself (:mod:`agents.link_sight`) beside its control loop, and what comes of it is recorded.

Whoever leads asks :meth:`TeamTree.is_in_force` before it lets robots go where another tree is needed.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

from agents.allegiance import AT_ONCE_S, Allegiance
from agents.collection import Collection as Others
from agents.link_sight import Scene, judge_links, stages_in_sight
from agents.mission import Mission
from agents.records import LogLine, TopologyChange, TreeAnswer
from agents.role import Compute, Effect, Event, Heard, JobDone, Publish, Record, Woken
from agents.standing_orders import StandingOrders
from agents.surroundings import Body, Estimate, Surroundings
from planning.environment import Environment
from protocol import core
from protocol.core import Note, Tick, WakeAt
from protocol.held_tree import HeldTree
from protocol.membership import Presence
from protocol.messages import (
    Authority,
    Confirmation,
    Edge,
    LinkView,
    Method,
    Milestone,
    Motion,
    NewLink,
    Point,
    Reign,
    Topology,
    TreeNumber,
)
from protocol.negotiation import Deposed, Elected, Negotiation, Propose, Settled, Withdraw, Word
from protocol.negotiation import Event as NegotiationEvent
from protocol.topology import in_words
from protocol.topology_states import Phase

JUDGING: Final = "judging links"
FORESEEING: Final = "foreseeing links"
"""Names of the jobs: as an end of links, and as the leader that proposes them."""

ANSWER_S: Final = 1.0
"""The standing answer is said again after this …"""

ANSWER_EARLY_S: Final = 0.1
"""… or so much earlier, if the peer is awake anyway: then it need not be woken for that."""


@dataclass(frozen=True, slots=True)
class _Wish:
    """A tree that the leader is about to propose."""

    members: tuple[str, ...]
    edges: tuple[Edge, ...]
    motion: Motion | None
    method: Method
    reason: str


class TeamTree:
    """See the module.

    Args:
        mission: roster.
        environment: the map as drawn.
        allegiance: whose word counts, and whether this peer leads.
        orders: as this peer has taken them.
        others: where they are.
        body: this peer's own, if it is a robot; the base station stands, and accepts any motion.
        estimate: of where an agent is that does not announce its way.
    """

    hears = frozenset({"topology", "confirmation", "deployment"})
    """The last since links are judged as soon as the motion is ordered that they are about."""

    def __init__(
        self,
        mission: Mission,
        environment: Environment,
        allegiance: Allegiance,
        orders: StandingOrders,
        others: Others,
        body: Body | None = None,
        estimate: Estimate | None = None,
    ) -> None:
        self.held = HeldTree(allegiance.name)
        self._name = allegiance.name
        self._voters = (mission.base_station.name, *(robot.name for robot in mission.robots))
        self._allegiance = allegiance
        self._surroundings = Surroundings(mission, environment, allegiance.name, orders, others, body, estimate)
        self._negotiation = Negotiation(self._voters)
        self._reign: Reign | None = None
        """That the negotiation is of."""
        self._said = 0
        """Words in this reign."""
        self._wish: _Wish | None = None
        self._judging: tuple[TreeNumber, tuple[NewLink, ...]] | None = None
        """What a job is about: a proposal, and links of it."""
        self._epoch = -1
        """Of the last word heard."""
        self._answer: Confirmation | None = None
        """What was said last."""
        self._answer_at_s = -math.inf
        self._tick_s = math.inf
        self._news = False
        """Whether a proposal has been settled, or can be made now, since this peer was woken."""
        self._complaints: dict[str, str] = {}
        """What was wrong last, by what it was about; said once, however often it happens."""
        self._effects: list[Effect] = []

    @property
    def next_s(self) -> float:
        """When something is to be said."""
        return AT_ONCE_S if self._news else min(self._answer_at_s, self._tick_s)

    @property
    def collecting(self) -> bool:
        """Whether this leader has yet to learn what was in force before it; until then nothing can be proposed."""
        return self._negotiation.phase is Phase.COLLECTING

    @property
    def busy(self) -> bool:
        """Whether a proposal of this leader is being made, or is open."""
        return self._wish is not None or self._negotiation.proposal is not None

    def is_in_force(self, edges: Collection[Edge]) -> bool:
        """Whether this tree has been confirmed in this peer's own reign, and is in force."""
        return self._negotiation.is_in_force(self._members(edges), edges)

    def may_propose(self, now_s: float, *, urgent: bool) -> bool:
        """Whether another tree can be proposed now; ``urgent``: the one in force does not serve any more."""
        return not self.busy and self._negotiation.may_propose(now_s, urgent)

    def serves(self, places: Mapping[str, Point], now_s: float) -> bool:
        """Whether the tree in force still does: its members are there, and it reaches to where the agent may be.

        Args:
            places: base station and robots that are there, and where they are or go.
            now_s: the time.
        """
        tree, around = self._negotiation.committed, self._surroundings
        if tree is None or around.agent not in tree.members or set(tree.members) - {around.agent} - places.keys():
            return False
        links = [edge for edge in tree.edges if around.agent in edge]
        scene = Scene(around.environment, None, places, around.agent, around.may_be(now_s))
        return None not in stages_in_sight(scene, links)

    def propose(
        self, edges: Collection[Edge], motion: Motion | None, method: Method, reason: str, now_s: float
    ) -> list[Effect]:
        """Begin to negotiate another tree; only when :meth:`may_propose`.

        Args:
            edges: of the tree, which joins all that they name, or only the base station.
            motion: that leads to where it can be; None: everybody stands.
            method: how it was found.
            reason: why it is to replace the one before.
            now_s: the time.
        """
        self._wish = _Wish(self._members(edges), tuple(edges), motion, method, reason)
        scene = self._surroundings.scene(motion, now_s)
        return [Compute(FORESEEING, stages_in_sight, (scene, self._wish.edges))]

    def withdraw(self, reason: str, now_s: float) -> list[Effect]:
        """Give up what is being proposed."""
        self._wish = None
        self._negotiate(Withdraw(reason), now_s)
        return self._collect()

    def look(self, now_s: float) -> list[Effect]:
        """Have links judged that have been waiting for orders of this peer itself, which have been given now."""
        self._judge(now_s)
        return self._collect()

    def handle(self, event: Event, now_s: float) -> Iterable[Effect]:
        """Take up or leave the office, hear words and answers, judge links, and say what is due."""
        self._news = False
        if self._reign is None and self._allegiance.reign is None and self._is_nothing(event, now_s):
            return ()
        self._follow_office(now_s)
        match event:
            case Heard(_, envelope) if isinstance(envelope.body, Topology):
                self._hear_word(envelope.body, envelope.sender, envelope.incarnation, now_s)
            case Heard(_, envelope) if isinstance(envelope.body, Confirmation):
                if self._allegiance.leads(now_s):
                    self._negotiate(core.Heard(envelope.sender, envelope.incarnation, envelope.body), now_s)
            case JobDone(job=name) if name == JUDGING:
                self._judged(event)
            case JobDone(job=name) if name == FORESEEING:
                self._foreseen(event, now_s)
        if self._reign is not None and now_s >= self._tick_s:
            self._negotiate(Tick(), now_s)
        self._judge(now_s)
        self._confirm(now_s)
        return self._collect()

    def _is_nothing(self, event: Event, now_s: float) -> bool:
        """Whether a peer that does not lead has nothing to do, as mostly: the answers are for the leader."""
        if isinstance(event, Heard):
            return isinstance(event.envelope.body, Confirmation)
        return isinstance(event, Woken) and self.held.proposal is None and now_s < self._answer_at_s - ANSWER_EARLY_S

    def _collect(self) -> list[Effect]:
        effects, self._effects = self._effects, []
        return effects

    def _members(self, edges: Collection[Edge]) -> tuple[str, ...]:
        return tuple(dict.fromkeys((self._voters[0], *(end for edge in edges for end in edge))))

    def _follow_office(self, now_s: float) -> None:
        """Begin to negotiate when this peer has been elected, and end when it leads no more."""
        reign = self._allegiance.reign
        if reign == self._reign:
            return
        self._reign, self._said, self._wish = reign, 0, None
        if reign is None:
            self._negotiate(Deposed(), now_s)
        else:
            present = frozenset(name for name in self._voters if self._allegiance.presence(name) is Presence.PRESENT)
            self._negotiate(Elected(reign.epoch, present), now_s)

    def _negotiate(self, event: NegotiationEvent, now_s: float) -> None:
        collecting = self.collecting
        effects = self._negotiation.handle(event, now_s)
        self._news = self._news or (collecting and not self.collecting)
        for effect in effects:
            match effect:
                case Word():
                    self._say(effect, now_s)
                case Settled():
                    self._settle(effect)
                case Note(level, text):
                    self._log(level, text)
                case WakeAt(time_s):
                    self._tick_s = time_s

    def _say(self, word: Word, now_s: float) -> None:
        """Publish a word, and take it as all others do; without a lease nothing is said."""
        warrant = self._allegiance.warrant(now_s)
        if warrant is None or self._reign is None:
            return
        self._said += 1
        authority = Authority(epoch=self._reign.epoch, leader=self._name, sequence=self._said)
        body = Topology(authority=authority, warrant=warrant, committed=word.committed, proposal=word.proposal)
        self._effects.append(Publish(body))
        self._hear_word(body, self._name, self._allegiance.incarnation, now_s)

    def _hear_word(self, word: Topology, sender: str, incarnation: int, now_s: float) -> None:
        if self._allegiance.take("topology", word.authority, sender, incarnation, word.warrant, now_s):
            return
        fault = self.held.take(word)
        self._complain("warning", f"does not take the word of {sender}: ", fault)
        if word.proposal is not None or word.authority.epoch != self._epoch:
            self._answer_at_s = AT_ONCE_S
        self._epoch = word.authority.epoch

    def _judge(self, now_s: float) -> None:
        """Have those links judged that can be, as soon as the motion is accepted that they are about."""
        links = self.held.to_judge()
        if self._judging is not None or not links or self._allegiance.obeyed(now_s) is None:
            return
        scene, ready = self._surroundings.ready_to_judge(links, now_s)
        if ready:
            assert self.held.proposal is not None
            self._judging = self.held.proposal.tree.number, ready
            self._effects.append(Compute(JUDGING, judge_links, (scene, self._name, ready)))

    def _judged(self, done: JobDone) -> None:
        judging, self._judging = self._judging, None
        if judging is None:
            return
        number, links = judging
        self._complain("error", "links could not be judged: ", done.failure)
        views: tuple[LinkView, ...] = () if done.failure else done.result
        if done.failure:  # what cannot be judged is not confirmed, and not judged again
            why = f"{self._name} could not judge it: {done.failure}"[:500]
            others = (next((end for end in link.ends if end != self._name), self._name) for link in links)
            views = tuple(LinkView(peer=other, verdict="refuses", reason=why) for other in others)
        self.held.judge(number, views)

    def _foreseen(self, done: JobDone, now_s: float) -> None:
        """Propose what was wished, now that it is known from which stage on its links hold."""
        wish, self._wish = self._wish, None
        if wish is None or self._reign is None:
            return
        self._news = True
        stages: Sequence[int | None] = [None] * len(wish.edges) if done.failure else done.result
        blind = [edge for edge, stage in zip(wish.edges, stages, strict=True) if stage is None]
        why = done.failure or "their ends do not see each other where they come to a stop"
        fault = f"{in_words(blind)}: {why}" if blind else ""
        self._complain("warning", "does not propose the links ", fault)
        if fault:
            return
        motion, epoch = wish.motion, self._reign.epoch
        since = {
            frozenset(edge): Milestone(epoch=epoch, plan=motion.plan, revision=motion.revision, stage=stage)
            for edge, stage in zip(wish.edges, stages, strict=True)
            if motion is not None and stage is not None
        }
        base = self._voters[0]
        # The base station stands where everybody knows: the team need not wait until its process is there again.
        absent = frozenset[str]() if self._allegiance.presence(base) is Presence.PRESENT else frozenset({base})
        self._negotiate(Propose(wish.members, wish.edges, since, wish.method, wish.reason, absent), now_s)

    def _settle(self, done: Settled) -> None:
        self._news = True
        proposal, before = done.proposal, done.before
        since = next((link.since for link in proposal.links if link.since is not None), None)
        self._effects.append(
            Record(
                TopologyChange(
                    number=proposal.tree.number,
                    committed=done.committed,
                    before=() if before is None else before.edges,
                    members=proposal.tree.members,
                    edges=proposal.tree.edges,
                    new=tuple(link.ends for link in proposal.links),
                    released=proposal.released,
                    absent=tuple(sorted(done.absent)),
                    motion=None if since is None else (since.plan, since.revision),
                    method=proposal.method,
                    rounds=proposal.round + 1,
                    duration_s=done.duration_s,
                    reason=done.reason,
                )
            )
        )

    def _confirm(self, now_s: float) -> None:
        """Say the standing answer if it is another one, or due; the leader takes its own as any other."""
        answer = self.held.confirmation
        if now_s < self._answer_at_s - ANSWER_EARLY_S and (answer is self._answer or answer == self._answer):
            return
        if answer != self._answer:
            self._effects.append(Record(_describe(answer)))
        self._answer, self._answer_at_s = answer, now_s + ANSWER_S
        self._effects.append(Publish(answer))
        if self._allegiance.leads(now_s):
            self._negotiate(core.Heard(self._name, self._allegiance.incarnation, answer), now_s)

    def _complain(self, level: Literal["warning", "error"], what: str, why: str) -> None:
        """Log what is wrong; the same only once, however often it happens."""
        if why and why != self._complaints.get(what):
            self._log(level, f"{what}{why}")
        self._complaints[what] = why

    def _log(self, level: Literal["info", "warning", "error"], text: str) -> None:
        self._effects.append(Record(LogLine(level=level, text=text)))


def _describe(answer: Confirmation) -> TreeAnswer:
    """An answer for the recording."""
    return TreeAnswer(
        proposal=answer.proposal,
        confirmed=tuple(view.peer for view in answer.views if view.verdict != "refuses"),
        kept=None if answer.committed is None else answer.committed.number,
    )

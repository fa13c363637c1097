"""Faults of live teams: what a timetable does to processes and links, and what people may ask for."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import cast

import pytest
from typer.testing import CliRunner

from agents.mission import Mission
from agents.records import Mishap
from launcher import chaos_control
from launcher.chaos import Chaos, LiveFault, check_live
from launcher.chaos_control import listening, obey, order_of_key
from launcher.cli import app
from launcher.fault_order import Answer, Order, give_order, shortened
from launcher.fault_timetable import (
    Cut,
    Delay,
    Fault,
    FaultyTimetable,
    Kill,
    Loss,
    Partition,
    Pause,
    Timetable,
)
from launcher.ground import Ground
from launcher.replacement import Replacements
from launcher.run_folder import RunFolder
from launcher.scenario import ScenarioFault
from launcher.supervisor import Supervisor
from planning.environment import Environment
from protocol.link_faults import CUT, LinkTable
from protocol.messages import Point

NAMES = ("base", "agent", "robot1", "robot2")


class Stand:
    """Stands in for a supervisor: notes what it is told to do."""

    def __init__(self) -> None:
        self.done: list[tuple[object, ...]] = []
        self.down: set[str] = set()

    def start(self, name: str, place: Point | None) -> bool:
        self.done.append(("start", name, place))
        return name in self.down

    def kill(self, name: str, back_after_s: float | None, *, lose_disk: bool = False) -> bool:
        self.done.append(("kill", name, back_after_s, lose_disk))
        return name not in self.down

    def pause(self, name: str, for_s: float) -> bool:
        self.done.append(("pause", name, for_s))
        return name not in self.down


class Rig:
    """A chaos, its links, and what it noted."""

    def __init__(self, mission: Mission, folder: Path) -> None:
        self.stand = Stand()
        self.links = LinkTable(folder / "links", NAMES, create=True)
        self.noted: list[Mishap] = []
        self.leader: str | None = "base"
        self.now_s = 0.0
        supervisor = cast(Supervisor, self.stand)
        self.places = {"agent": (4.0, 1.0), "robot1": (1.0, 4.0)}
        ground = Ground(folder / "map.json", Environment([(0, 0), (6, 0), (6, 6), (0, 6)]))
        self.replacements = Replacements(mission, ground, supervisor, self.places.get)
        self.chaos = Chaos(mission, supervisor, self.links, lambda: self.leader, lambda: self.now_s, self.noted.append)

    def lost(self) -> dict[tuple[str, str], int]:
        return {(a, b): lost for a in NAMES for b in NAMES if (lost := self.links.lost_percent(a, b))}


@pytest.fixture
def rig(mission: Mission, tmp_path: Path) -> Rig:
    return Rig(mission, tmp_path)


def both_ways(one: str, *others: str) -> dict[tuple[str, str], int]:
    return {pair: CUT for other in others for pair in ((one, other), (other, one))}


async def until(condition: Callable[[], bool]) -> None:
    while not condition():
        await asyncio.sleep(0.005)


def test_a_timetable_happens_in_order_of_time_and_the_leader_is_who_leads_then(rig: Rig) -> None:
    faults: tuple[LiveFault, ...] = (
        Kill(at_s=0.10, for_s=3.0, who="leader", disk="lost"),
        Pause(at_s=0.05, for_s=0.02, who="robot2"),
        Kill(at_s=0.0, who="robot1"),
    )
    rig.leader = None

    async def play() -> None:
        rig.chaos.play(faults)
        await until(lambda: len(rig.stand.done) == 2)
        await asyncio.sleep(0.15)
        assert len(rig.stand.done) == 2, "nobody leads: the next to lead is meant"
        rig.leader = "robot1"
        await until(lambda: len(rig.stand.done) == 3)

    asyncio.run(play())
    assert rig.stand.done == [
        ("kill", "robot1", None, False),
        ("pause", "robot2", 0.02),
        ("kill", "robot1", 3.0, True),
    ]
    assert [(mishap.kind, mishap.who, mishap.over) for mishap in rig.noted] == [
        ("kill", ("robot1",), False),
        ("pause", ("robot2",), False),
        ("pause", ("robot2",), True),
        ("kill", ("robot1",), False),
    ]


def test_what_cannot_be_done_is_said_and_the_rest_goes_on(rig: Rig) -> None:
    rig.stand.down = {"robot1"}

    async def play() -> None:
        rig.chaos.play((Kill(at_s=0.0, who="robot1"), Kill(at_s=0.01, who="robot2")))
        await until(lambda: len(rig.stand.done) == 2)

    asyncio.run(play())
    assert [mishap.text for mishap in rig.noted] == [
        "nothing done: robot1 has no process to kill at the moment",
        "robot2 is killed",
    ]


def test_links_are_cut_as_long_as_a_fault_lasts_and_a_cut_outdoes_a_loss(rig: Rig) -> None:
    async def play() -> None:
        rig.chaos.begin(Partition(at_s=0.0, group=("robot1",)))
        assert rig.lost() == both_ways("robot1", "base", "agent", "robot2")
        rig.chaos.begin(Cut(at_s=0.0, for_s=0.02, speakers=("agent",), hearers=("base",)))
        assert rig.lost() == both_ways("robot1", "base", "agent", "robot2") | {("agent", "base"): CUT}
        rig.chaos.begin(Loss(at_s=0.0, share=0.3))
        assert rig.lost()["base", "agent"] == 30
        assert rig.lost()["base", "robot1"] == CUT
        assert len(rig.lost()) == 12
        rig.chaos.begin(Loss(at_s=0.0, share=0.1, speakers=("base",)))
        assert (rig.lost()["base", "agent"], rig.lost()["agent", "robot2"]) == (10, 30)
        await until(lambda: rig.lost()["agent", "base"] == 30)
        assert rig.chaos.heal("robot1") == 2, "the partition, and the loss on all links; that of base does not touch it"
        assert rig.lost() == {("base", name): 10 for name in NAMES[1:]}
        assert rig.chaos.heal() == 1
        assert rig.lost() == {}
        assert rig.chaos.heal() == 0

    asyncio.run(play())
    assert sum(mishap.over for mishap in rig.noted) == sum(not mishap.over for mishap in rig.noted) == 4


def test_an_end_that_was_healed_away_does_not_end_a_later_fault(rig: Rig) -> None:
    async def play() -> None:
        rig.chaos.begin(Partition(at_s=0.0, for_s=0.02, group=("robot1",)))
        rig.chaos.heal()
        rig.chaos.begin(Partition(at_s=0.0, for_s=60.0, group=("robot1",)))
        await asyncio.sleep(0.05)
        assert len(rig.lost()) == 6

    asyncio.run(play())


@pytest.mark.parametrize(
    ("fault", "sentence"),
    [
        (Delay(at_s=1.0, mean_s=0.1), "faults[0].kind is 'delay', which only `sightline simulate` knows; "),
        (Loss(at_s=1.0, share=0.5, burst=4.0), "faults[0].burst is 4, and live teams lose one publication at a time; "),
        (Kill(at_s=1.0, who="base", disk="lost"), "faults[0] loses the disk of a peer that does not come back; "),
    ],
)
def test_what_a_live_team_cannot_do_is_one_sentence(mission: Mission, fault: Fault, sentence: str) -> None:
    with pytest.raises(ScenarioFault) as refused:
        check_live(Timetable(faults=(fault,)), mission)
    assert str(refused.value).startswith(sentence)


def test_who_is_not_on_the_roster_is_refused(mission: Mission) -> None:
    with pytest.raises(FaultyTimetable, match="robot9"):
        check_live(Timetable(faults=(Pause(at_s=0.0, for_s=1.0, who="robot9"),)), mission)
    kept = (Pause(at_s=0.0, for_s=1.0, who="leader"),)
    assert check_live(Timetable(faults=kept), mission) == kept


@pytest.mark.parametrize(
    ("order", "sentence"),
    [
        (Order(action="kill", who=("robot_2",)), "no peer is called robot_2: did you mean robot2"),
        (Order(action="kill", who=("x",)), "no peer is called x: choose one of base, agent, robot1, robot2, leader"),
        (Order(action="kill"), "kill: name one peer, or leader"),
        (Order(action="pause", who=("base", "agent")), "pause: name one peer, or leader"),
        (Order(action="cut", who=NAMES[:3]), "cut: name one peer to cut off, or two"),
        (Order(action="cut", who=("base", "base")), "cut: base cannot be cut off from itself"),
        (Order(action="heal", who=("base", "agent")), "heal: name one peer at most"),
        (Order(action="heal", for_s=2.0), "--for does not go with heal; leave it out"),
        (Order(action="start"), "start: name one peer"),
        (Order(action="start", who=("leader",)), "no peer is called leader: choose one of base, agent, robot1, robot2"),
        (Order(action="start", who=("robot1",), for_s=2.0), "--for does not go with start; leave it out"),
        (Order(action="kill", who=("base",), at=(1.0, 2.0)), "--at does not go with kill; leave it out"),
        (Order(action="start", who=("base",), at=(1.0, 2.0)), "--at [1, 2] is for robots, and base is none; leave"),
    ],
)
def test_an_order_that_does_not_fit_is_one_sentence_and_nothing_happens(rig: Rig, order: Order, sentence: str) -> None:
    answer = obey(order, rig.chaos, rig.replacements, NAMES)
    assert not answer.done
    assert answer.text.startswith(sentence)
    assert rig.stand.done == []
    assert rig.lost() == {}


def test_orders(rig: Rig) -> None:
    async def play() -> list[str]:
        orders = (
            Order(action="kill", who=("leader",), for_s=2.0),
            Order(action="pause", who=("robot1",)),
            Order(action="cut", who=("leader", "robot2")),
            Order(action="heal"),
        )
        return [answer.text for order in orders if (answer := obey(order, rig.chaos, rig.replacements, NAMES)).done]

    said = asyncio.run(play())
    assert said == [
        "base is killed",
        "robot1 is paused",
        "base and robot2 are cut off from each other",
        "2 faults of links ended",
    ]
    assert rig.stand.done == [("kill", "base", 2.0, False), ("pause", "robot1", chaos_control.PAUSE_S)]
    rig.leader = None
    assert obey(Order(action="kill", who=("leader",)), rig.chaos, rig.replacements, NAMES).text.startswith(
        "nobody is known to lead"
    )


def test_a_peer_that_is_gone_is_started_where_there_is_room_for_it(rig: Rig) -> None:
    def start(at: Point | None) -> Answer:
        return obey(Order(action="start", who=("robot2",), at=at), rig.chaos, rig.replacements, NAMES)

    assert start(None) == Answer(done=False, text="robot2 has a process; start those that have none")
    rig.stand.down = {"robot2"}
    rig.stand.done.clear()
    for at, sentence in (
        ((7.0, 1.0), "map.json: --at [7, 1] is inside a wall or off the map (x 0 to 6, y 0 to 6); move it"),
        ((5.9, 3.0), "map.json: --at [5.9, 3] is 0.10 m from a wall, nearer than its radius of 0.2 m; move it"),
        ((2.0, 4.5), "--at [2, 4.5] is 1.12 m from robot1, which may be driving; keep 1.40 m away from everybody"),
    ):
        answer = start(at)
        assert not answer.done
        assert sentence in answer.text
    assert rig.stand.done == []
    assert start((3.0, 4.0)) == start(None) == Answer(done=True, text="robot2 is started")
    assert rig.stand.done == [("start", "robot2", (3.0, 4.0)), ("start", "robot2", None)]


def test_keys() -> None:
    robots = NAMES[2:]
    assert order_of_key("k", robots) == Order(action="kill", who=("leader",), for_s=chaos_control.KEYS_FOR_S)
    assert order_of_key("2", robots) == Order(action="kill", who=("robot2",), for_s=chaos_control.KEYS_FOR_S)
    assert [key for key in "abdefgijlmnoqrstuvwxyz03456789\n\x1b" if order_of_key(key, robots)] == []


def test_an_order_reaches_the_launcher_of_a_folder_of_any_depth_and_nobody_when_it_is_over(
    mission: Mission, tmp_path: Path
) -> None:
    deep = tmp_path.joinpath(*["a_folder_of_a_long_name"] * 6)  # names of sockets have at most 108 characters
    deep.mkdir(parents=True)
    heard: list[Order] = []

    def answer(order: Order) -> Answer:
        heard.append(order)
        return Answer(done=order.action != "pause", text=f"{order.action} it is")

    async def play() -> tuple[str, str]:
        async with listening(deep, answer):
            done = await asyncio.to_thread(give_order, RunFolder(deep), mission, Order(action="heal"))
            with shortened(deep) as short:
                _, writer = await asyncio.open_unix_connection(short / "control")
            writer.write(b"nonsense" * 10_000)  # more than anybody reads
            writer.close()
            with pytest.raises(ScenarioFault) as refused:
                pause = Order(action="pause", who=("robot1",), for_s=1.0)
                await asyncio.to_thread(give_order, RunFolder(deep), mission, pause)
            return done, str(refused.value)

    assert asyncio.run(play()) == ("heal it is", "pause it is")
    assert heard == [Order(action="heal"), Order(action="pause", who=("robot1",), for_s=1.0)]
    assert list(deep.iterdir()) == []
    with pytest.raises(ScenarioFault, match="is over, or was not started by"):
        give_order(RunFolder(deep), mission, Order(action="heal"))
    with pytest.raises(ScenarioFault, match="did you mean robot2"):
        give_order(RunFolder(deep), mission, Order(action="kill", who=("robot22",)))


SCENARIO = """
map = "square.json"
[base]
position = [1.0, 1.0]
[agent]
start = [3.0, 3.0]
[robots]
count = 2
"""


SQUARE = '{"name": "square", "units": "metres", "outer": [[0, 0], [5, 0], [5, 5], [0, 5]], "holes": []}'


@pytest.mark.parametrize(
    ("where", "fault", "sentence"),
    [
        ("scenario", 'kind = "kill"\nat_s = -1\nwho = "base"', "faults[0].at_s"),
        (
            "scenario",
            'kind = "explode"\nat_s = 1\nwho = "base"',
            "faults[0].kind is 'explode'; choose one of kill, pause",
        ),
        ("scenario", 'kind = "clock"\nat_s = 1\nwho = "base"', "faults[0].kind is 'clock', which only `sightline sim"),
        ("timetable", 'kind = "kill"\nat_s = -1\nwho = "base"', "faults[0].at_s"),
        (
            "timetable",
            'kind = "kill"\nat_s = 1\nwho = "robot7"',
            "faults[0].who names 'robot7', who is not there; choose",
        ),
        ("timetable", 'kind = "pause"\nat_s = 1\nwho = "base"', "faults[0] pauses base for ever; add for_s"),
    ],
)
def test_a_fault_that_does_not_fit_is_one_sentence_and_nothing_starts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, where: str, fault: str, sentence: str
) -> None:
    scenario, timetable = tmp_path / "scenario.toml", tmp_path / "timetable.toml"
    entry = f"\n[[faults]]\n{fault}\n"
    (tmp_path / "square.json").write_text(SQUARE)
    scenario.write_text(SCENARIO + entry * (where == "scenario"))
    timetable.write_text(entry * (where == "timetable"))
    monkeypatch.chdir(tmp_path)
    chaos = ["--chaos", str(timetable)] if where == "timetable" else []
    answer = CliRunner().invoke(app, ["run", str(scenario), *chaos])
    assert answer.exit_code == 2, answer.output
    assert answer.stderr.startswith(f"sightline: {tmp_path / where}.toml: {sentence}")
    assert answer.stderr.count("\n") == 1
    assert not (tmp_path / "runs").exists()

"""Campaign: peers with real minds that are told anything: noise, confused types, mutants, replays, nonsense.

    make fuzz
    python -m tests.campaigns.fuzz --inputs 1000000 --seed 0

Every peer lives for some thousand inputs in virtual time; then it must still say that it lives, must not have failed on
anything, must have counted what it did not hear, and must not have grown or logged without bound. The campaign ends
with status 1 and prints seed, input and traceback if one of that does not hold.
"""

from __future__ import annotations

import argparse
import resource
import sys
import time
import traceback
from collections import Counter, deque
from collections.abc import Iterable, Sequence
from typing import Final, Literal

from agents.casting import Casting
from agents.mission import Mission, OnDemand, RosterEntry
from agents.records import AnyRecord, LogLine, Office
from agents.role import Compute, Effect, Event, Heard, JobDone, Persist, Written
from agents.shell import MAXIMUM_OPERATORS, PeerShell
from planning.environment import Environment
from protocol.bus import BusEvent, Received
from protocol.keys import Address
from protocol.messages import Method, Point, addressee_of, decode, kind_of
from tests.campaigns.arbitrary_messages import Mischief

NAMES: Final = ("base", "agent", "robot1", "robot2")
LIFE: Final = 4000
"""Inputs that one peer gets."""
STEP_S: Final = 0.01
"""Mission time between two inputs."""
JOBS_EVERY: Final = 100
"""After so many inputs one of the jobs that wait is done, whichever it is."""
MOST_JOBS: Final = 8
"""If more wait, the oldest never end, as if the machine were busy."""
MOST_LINES: Final = 1500
"""Log lines of a life; noise of one kind is logged once, but a peer may well say whom it obeys, again and again."""

ROOMS = Environment([(0, 0), (8, 0), (8, 3), (9, 3), (9, 0), (17, 0), (17, 6), (0, 6)], name="two rooms")


def make_mission(*, announces: bool = True, topology: Method = "optimum") -> Mission:
    """A small team in two rooms."""
    starts = ((1.0, 1.0), (3.0, 3.0), (2.0, 1.0), (1.0, 2.0))
    roles = ("base_station", "tracked_agent", "robot", "robot")
    return Mission(
        team="team",
        map_path="map.json",
        roster=tuple(
            RosterEntry(name=name, role=role, start=start)  # type: ignore[arg-type]
            for name, role, start in zip(NAMES, roles, starts, strict=True)
        ),
        behaviour=OnDemand(),
        robot_radius_m=0.2,
        agent_radius_m=0.2,
        robot_speed_m_s=1.0,
        agent_speed_m_s=1.0,
        control_hz=10.0,
        heartbeat_hz=2.0,
        planning_period_s=0.5,
        decomposition="inflection",
        duration_s=None,
        seed=0,
        epoch_unix_s=0.0,
        announces=announces,
        topology=topology,
    )


class Witnessed(PeerShell):
    """A shell that keeps the traceback of what its role failed on."""

    traceback = ""

    def _complain(self, level: Literal["warning", "error"], what: tuple[str, str], text: str) -> None:
        if level == "error" and not self.traceback:
            self.traceback = traceback.format_exc()
        super()._complain(level, what, text)


class Life:
    """One peer with its mind, from its birth on; what it publishes goes to whoever makes mischief of it."""

    def __init__(self, casting: Casting, name: str, seed: int = 0) -> None:
        self.name = name
        self.now_s = 0.0
        self.lines = self.published = self.given = 0
        self.led = False
        """Whether it was ever elected."""
        self.heard: Counter[str] = Counter()
        """Kinds of messages that its mind was given, and how many."""
        self.done: Counter[str] = Counter()
        """Names of jobs that were done beside it, and how many."""
        self._jobs: deque[Compute] = deque(maxlen=MOST_JOBS)
        self._promises: list[Persist] = []
        role, driver = casting.cast(name)
        self._role, self.hears = role, role.hears
        self.mischief = Mischief(seed, "team", NAMES, name, role.hears)
        self.shell = Witnessed(
            self, driver, self, name=name, team="team", incarnation=0, peers=NAMES, now=lambda: self.now_s,
            wall_clock=lambda: self.now_s, record=self._record, execute=self._jobs.append,
            persist=self._promises.append,
        )  # fmt: skip
        self.shell.start()

    def start(self, now_s: float, position: Point) -> Iterable[Effect]:
        """Of the role."""
        return self._role.start(now_s, position)

    def handle(self, event: Event, now_s: float) -> Iterable[Effect]:
        """Of the role: counts what is heard."""
        if isinstance(event, Heard):
            self.heard[kind_of(event.envelope.body)] += 1
        return self._role.handle(event, now_s)

    def publish(self, key: str, payload: bytes) -> None:
        """Of the bus: what the peer says is well-formed, whatever it was told."""
        envelope = decode(payload)
        assert key == Address("team", self.name, envelope.kind, to=addressee_of(envelope.body)).key
        self.published += 1
        self.mischief.overhear(envelope)

    def close(self) -> None:
        """Of the bus."""

    def give(self, event: BusEvent) -> None:
        """Let something happen to the peer, and a little time pass."""
        self.given += 1
        self.shell.take(event)
        while self._promises:
            self.shell.written(Written(self._promises.pop(0).token, "disk full" if self.given % 97 == 0 else ""))
        if self.given % JOBS_EVERY == 0 and self._jobs:
            job = self.mischief.chance.choice(self._jobs)
            self._jobs.remove(job)
            self.done[job.job] += 1
            try:
                result, failure = job.function(*job.arguments), ""
            except Exception as problem:
                result, failure = None, f"{type(problem).__name__}: {problem}"
                self.shell.traceback = self.shell.traceback or traceback.format_exc()
            self.shell.finish(JobDone(job.job, result, 0.1, failure))
        self.now_s += STEP_S
        if self.now_s >= self.shell.wake_at_s:
            self.shell.wake()

    def complaint(self) -> str:
        """What is wrong with the peer by now; empty if all is well."""
        if self.shell.traceback:
            return f"failed:\n{self.shell.traceback}"
        published = self.published
        for _ in range(round(2.0 / STEP_S)):
            self.give(Received("team/v1/nobody/heartbeat", b""))
        if self.published == published:
            return "says nothing any more"
        if self.lines > MOST_LINES:
            return f"logged {self.lines} lines"
        if len(self.shell.refused) > 6 or len(self.shell._operators) > MAXIMUM_OPERATORS:
            return "remembers without bound"
        return ""

    def _record(self, _: float, record: AnyRecord) -> None:
        self.lines += isinstance(record, LogLine)
        self.led |= isinstance(record, Office) and record.leads is not None


def make_castings() -> tuple[Casting, ...]:
    """Who makes the peers of both kinds of teams; the planners are compiled once.

    One agent announces its way, and its leader looks for trees alone; the other is measured, and trees are auctioned.
    """
    missions = make_mission(), make_mission(announces=False, topology="auction")
    castings = tuple(Casting(mission, ROOMS) for mission in missions)
    for casting in castings:
        casting.team_planner()
    return castings


def fuzz(
    inputs: int,
    first_seed: int,
    castings: Sequence[Casting],
    names: Iterable[str] = NAMES[:3],
    life: int = LIFE,
    heard: Counter[str] | None = None,
) -> list[str]:
    """Give so many inputs to one peer after the other, of one team and the other; what went wrong.

    Args:
        inputs: in all.
        first_seed: of the first peer; the next has the next.
        castings: make the peers.
        names: of the peers, in turn.
        life: inputs to each.
        heard: is told which kinds of messages minds were given.
    """
    complaints: list[str] = []
    refused: Counter[str] = Counter()
    heard = Counter() if heard is None else heard
    done: Counter[str] = Counter()
    given, led, seed, shown = 0, 0, first_seed, time.monotonic()
    order = tuple((casting, name) for casting in castings for name in names)
    while given < inputs:
        casting, name = order[seed % len(order)]
        peer = Life(casting, name, seed)
        for _ in range(min(life, inputs - given)):
            peer.give(peer.mischief.event())
            if peer.shell.traceback:
                break
        given += peer.given
        led += peer.led
        if complaint := peer.complaint():
            complaints.append(f"seed {seed}, {name}, input {peer.given}: {complaint}")
        refused += peer.shell.refused
        heard += peer.heard
        done += peer.done
        seed += 1
        if time.monotonic() - shown > 5.0:
            shown = time.monotonic()
            print(f"{given:,} of {inputs:,} inputs, {resident_mb():.0f} MB", file=sys.stderr, flush=True)
    reasons = ", ".join(f"{count:,} {reason}" for reason, count in refused.most_common())
    peers = f"{seed - first_seed} peers in turn, of which {led} were made to lead"
    print(f"{given:,} inputs to {peers}; refused: {reasons}; {len(complaints)} complaints")
    for what, counts in (("heard", heard), ("done", done)):
        print(f"{what}: " + ", ".join(f"{count:,} {name}" for name, count in counts.most_common()))
    return complaints


def resident_mb() -> float:
    """The most memory that this process has had, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def main() -> int:
    """Give the inputs; 1 if anything went wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inputs", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=0, help="of the first peer")
    options = parser.parse_args()
    castings = make_castings()
    begun = time.perf_counter()
    # What is loaded and cached on first use is there after a tenth.
    fuzz(options.inputs // 10, options.seed + 1_000_000, castings)
    before_mb = resident_mb()
    complaints = fuzz(options.inputs, options.seed, castings)
    grown_mb = resident_mb() - before_mb
    if grown_mb > 50.0:
        complaints.append(f"{grown_mb:.0f} MB more after {options.inputs:,} inputs")
    for complaint in complaints[:20]:
        print(complaint)
    print(f"{time.perf_counter() - begun:.0f} s, {grown_mb:.0f} MB more than after the first tenth")
    return int(bool(complaints))


if __name__ == "__main__":
    sys.exit(main())

"""A whole mission in virtual time: the roles of the live system, a seeded network, one process."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

import numpy as np
from msgspec import structs

from agents.casting import Casting
from agents.mission import Mission
from agents.records import AnyRecord
from agents.role import Compute, JobDone, Persist, Written
from agents.shell import PeerShell
from launcher.mission_trace import MissionTrace
from planning.environment import Environment
from protocol.bus import BusEvent
from protocol.simulated_bus import SimulatedNetwork, VirtualTime

if TYPE_CHECKING:
    from agents.leader import DeploymentPlanner
    from agents.recorder import Recorder

UNTIL_TOLD_S: Final = 60.0
"""Duration of a mission that sets none."""

WRITING_S: Final = 0.005
"""How long a disk takes to keep a promise."""


class SimulatedPeer:
    """A peer in virtual time: sleeps until it is due, computes inline and lets the result wait for its delay."""

    def __init__(
        self,
        time: VirtualTime,
        network: SimulatedNetwork,
        casting: Casting,
        mission: Mission,
        name: str,
        record: Callable[[float, str, AnyRecord], None],
    ) -> None:
        self._time = time
        self._network = network
        self._mission = mission
        self._name = name
        self._record = record
        self._role, self._driver = casting.cast(name)
        self._due_s = math.inf

    def start(self) -> None:
        """Join the network and let the role begin."""
        self._shell = PeerShell(
            self._role,
            self._driver,
            self._network.attach(self._name, self._take, kinds=self._role.hears),
            name=self._name,
            team=self._mission.team,
            incarnation=0,
            peers=[entry.name for entry in self._mission.roster],
            now=lambda: self._time.now_s,
            wall_clock=lambda: self._mission.epoch_unix_s + self._time.now_s,
            record=lambda time_s, record: self._record(time_s, self._name, record),
            execute=self._execute,
            persist=self._persist,
        )
        self._shell.start()
        self._sleep()

    def _take(self, event: BusEvent) -> None:
        self._shell.take(event)
        self._sleep()

    def _execute(self, job: Compute) -> None:
        result, failure = None, ""
        try:
            result = job.function(*job.arguments)
        except Exception as problem:
            failure = f"{type(problem).__name__}: {problem}"
        delay_s = self._mission.planning_delay_s
        self._time.call_at(self._time.now_s + delay_s, self._finish, JobDone(job.job, result, delay_s, failure))

    def _persist(self, content: Persist) -> None:
        self._time.call_at(self._time.now_s + WRITING_S, self._wrote, Written(content.token))

    def _wrote(self, written: Written) -> None:
        self._shell.written(written)
        self._sleep()

    def _finish(self, done: JobDone) -> None:
        self._shell.finish(done)
        self._sleep()

    def _sleep(self) -> None:
        """Have :meth:`_wake` called when the shell is due; calls for times no longer wished for find that out."""
        if self._shell.wake_at_s != self._due_s:
            self._due_s = self._shell.wake_at_s
            self._time.call_at(self._due_s, self._wake, self._due_s)

    def _wake(self, due_s: float) -> None:
        if due_s == self._due_s:
            self._due_s = math.inf
            self._shell.wake()
            self._sleep()


def simulate(
    mission: Mission,
    environment: Environment,
    *,
    recorder: Recorder | None = None,
    duration_s: float | None = None,
    seed: int | None = None,
    loss: float = 0.0,
    planner: DeploymentPlanner | None = None,
) -> MissionTrace:
    """Run a mission in virtual time.

    Args:
        mission: the same that processes would read.
        environment: its map.
        recorder: is given every record as it is made; the caller closes it.
        duration_s: instead of the mission's; 60 s if neither says.
        seed: instead of the mission's. Equal seeds give equal traces, to the last bit.
        loss: probability that a peer misses a message.
        planner: of a mission that differs in its seed only; saves building another.

    Returns:
        What the peers recorded.

    Raises:
        ValueError: the map leaves no room for a peer where it starts, or cannot be planned on; or the
            loss is no probability.
    """
    if seed is not None:
        mission = structs.replace(mission, seed=seed)
    ends_s = duration_s or mission.duration_s or UNTIL_TOLD_S
    records: list[tuple[float, str, AnyRecord]] = []

    def record(time_s: float, peer: str, what: AnyRecord) -> None:
        records.append((time_s, peer, what))
        if recorder is not None:
            recorder.record(time_s, peer, what)

    time = VirtualTime()
    network = SimulatedNetwork(time, mission.seed, loss=loss)
    casting = Casting(mission, environment, planner)
    peers = [SimulatedPeer(time, network, casting, mission, entry.name, record) for entry in mission.roster]
    # Processes do not beat in step; here the seed says by how much they differ.
    phases_s = np.random.default_rng([mission.seed, len(peers)]).uniform(0.0, 1.0 / mission.control_hz, len(peers))
    for peer, phase_s in zip(peers, phases_s, strict=True):
        time.call_at(float(phase_s), peer.start)
    time.run_until(ends_s)
    return MissionTrace.of(records, mission, ends_s)

"""A whole mission in virtual time: the roles of the live system, a seeded network, one process."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Final

import numpy as np
from msgspec import structs

from agents.casting import Casting
from agents.mission import Mission
from agents.records import AnyRecord
from launcher.fault_injection import FaultInjection
from launcher.fault_timetable import Timetable
from launcher.mission_trace import MissionTrace
from launcher.simulated_peer import SimulatedPeer, holds_lease
from planning.environment import Environment
from protocol.simulated_bus import SimulatedNetwork, VirtualTime

if TYPE_CHECKING:
    from agents.leader import DeploymentPlanner
    from agents.recorder import Recorder

UNTIL_TOLD_S: Final = 60.0
"""Duration of a mission that sets none."""

WORLD: Final = "launcher"
"""Who records what goes wrong on purpose."""


class SimulatedTeam:
    """All peers of a mission on one network, with one true time; nothing has happened yet.

    Args:
        mission: the same that processes would read.
        casting: gives the peers their roles and bodies.
        record: takes what they record: true time, name, record.
        faults: what goes wrong when, held against the roster (:func:`launcher.fault_timetable.checked`).
        loss: probability that a peer misses a message, on sound links too.
        watch: called with a peer after each event that it has handled.
    """

    def __init__(
        self,
        mission: Mission,
        casting: Casting,
        record: Callable[[float, str, AnyRecord], None],
        *,
        faults: Timetable | None = None,
        loss: float = 0.0,
        watch: Callable[[SimulatedPeer], None] | None = None,
    ) -> None:
        self.time = time = VirtualTime()
        self.network = SimulatedNetwork(time, mission.seed, loss=loss)
        self.peers = {
            entry.name: SimulatedPeer(time, self.network, casting, mission, entry.name, record, watch)
            for entry in mission.roster
        }
        self.faults = FaultInjection(
            time,
            self.network,
            self.peers,
            faults or Timetable(),
            self.leader,
            lambda mishap: record(time.now_s, WORLD, mishap),
        )
        # Processes do not beat in step; here the seed says by how much they differ.
        chance = np.random.default_rng([mission.seed, len(self.peers)])
        phases_s = chance.uniform(0.0, 1.0 / mission.control_hz, len(self.peers))
        for peer, phase_s in zip(self.peers.values(), phases_s, strict=True):
            time.call_at(float(phase_s), self._begin, peer)

    def _begin(self, peer: SimulatedPeer) -> None:
        if not self.faults.keep_away(peer.name):  # who is killed before that comes late, or never
            peer.start()

    def leader(self) -> str | None:
        """Who holds an unexpired lease now."""
        return next((name for name, peer in self.peers.items() if holds_lease(peer)), None)


def simulate(
    mission: Mission,
    environment: Environment,
    *,
    recorder: Recorder | None = None,
    duration_s: float | None = None,
    seed: int | None = None,
    loss: float = 0.0,
    faults: Timetable | None = None,
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
        faults: what goes wrong when; names are those of the roster (:func:`launcher.fault_timetable.checked`).
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

    team = SimulatedTeam(mission, Casting(mission, environment, planner), record, faults=faults, loss=loss)
    team.time.run_until(ends_s)
    return MissionTrace.of(records, mission, ends_s)

"""The team as somebody sees it who only listens: who is up, what they do, whether the chain holds now.

:class:`TeamView` is pure: envelopes and tokens go in, a :class:`Status` comes out. It needs no clock but the time that
it is given.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from agents.mission import Mission
from agents.role import Heard, Woken
from agents.shared_estimate import SharedEstimate
from agents.target_set import TargetSet
from planning.connectivity import chain_connected
from planning.environment import Environment
from protocol.bus import BusEvent, PeerAppeared, PeerVanished, Received
from protocol.election import LEASE_S
from protocol.keys import parse
from protocol.messages import (
    Deployment,
    Envelope,
    Heartbeat,
    Intent,
    MalformedMessage,
    Placement,
    Point,
    State,
    VoteRequest,
    decode,
)

SILENT_AFTER_S = 2.0
"""A peer that has said nothing for so long does not count as up, whatever its token says."""


@dataclass(frozen=True, slots=True)
class PeerStatus:
    """One peer, as last heard."""

    name: str
    up: bool
    mode: str
    """As in the messages; ``starting`` before the first, ``lost`` when a peer that spoke is not up."""
    position: Point | None
    obeying: bool
    """It has accepted the motion to a deployment."""


@dataclass(frozen=True, slots=True)
class Status:
    """The team at one moment."""

    peers: tuple[PeerStatus, ...]
    goal: Point | None
    """Where the agent says it goes."""
    deployment: Deployment | None
    """The leader's standing order."""
    leader: str | None
    """Who has been heard to lead lately."""
    estimate: TargetSet | None
    """Where an independent agent may be: nobody is told where it is."""
    agent_visible: bool | None
    """The base station or some robot that is up sees the agent; None: nobody knows."""
    chain_connected: bool
    """The agent is joined to the base station through robots that see one another; by true line of sight between the
    positions heard, through the map's walls. Of an independent agent: the base station is joined to all relays so."""
    links: int
    """Pairs of the team that see each other."""

    @property
    def up(self) -> int:
        """How many peers are up."""
        return sum(peer.up for peer in self.peers)

    @property
    def relays(self) -> int:
        """How many robots are vertices of the deployment."""
        placements = self.deployment.placements if self.deployment else ()
        return sum(not placement.spare for placement in placements)


@dataclass
class _Known:
    heard_at_s: float = float("-inf")
    spoke: bool = False
    token: bool = False
    mode: str = "starting"
    position: Point | None = None
    obeying: bool = False
    order: tuple[int, int] = (-1, -1)


@dataclass
class TeamView:
    """What has been heard of a team; of an independent agent also by an estimate that only listens."""

    mission: Mission
    environment: Environment
    estimate: SharedEstimate | None = None
    malformed: int = 0
    """Messages that were no message of this schema, or not by the peer whose key they used."""
    goal: Point | None = None
    deployment: Deployment | None = None
    _known: dict[str, _Known] = field(default_factory=dict)
    _reign: tuple[int, str] = (-1, "")
    """The highest epoch that a leader in office has spoken in, and who that was."""
    _reigned_at_s: float = float("-inf")
    """When it was heard last."""

    def __post_init__(self) -> None:
        self._known = {entry.name: _Known() for entry in self.mission.roster}

    def handle(self, event: BusEvent, now_s: float) -> None:
        """Take in one event of the bus."""
        match event:
            case PeerAppeared(peer):
                if peer in self._known:
                    self._known[peer].token = True
            case PeerVanished(peer):
                if peer in self._known:
                    self._known[peer].token = False
            case Received(key, payload):
                address = parse(key)
                if address is None or address.operator:
                    return
                try:
                    envelope = decode(payload)
                except MalformedMessage:
                    self.malformed += 1
                    return
                if envelope.sender != address.speaker or envelope.sender not in self._known:
                    self.malformed += 1
                    return
                if self.estimate is not None and address.kind in self.estimate.hears:
                    deque(self.estimate.handle(Heard(address, envelope), now_s), maxlen=0)
                self._hear(envelope, now_s)

    def _hear(self, envelope: Envelope, now_s: float) -> None:
        known = self._known[envelope.sender]
        order = (envelope.incarnation, envelope.sequence)
        if order <= known.order:
            return  # late or twice
        known.order, known.heard_at_s, known.spoke, known.token = order, now_s, True, True
        match envelope.body:
            case Heartbeat(mode=mode):
                known.mode = mode
            case State(position=position, mode=mode, progress=progress):
                known.position, known.mode, known.obeying = position, mode, progress is not None
            case Intent(position=position, mode=mode, goal=goal):
                known.position, known.mode, self.goal = position, mode, goal
            case VoteRequest(epoch=epoch, warrant=warrant) if warrant is not None:
                self._note_reign(epoch, envelope.sender, now_s)
            case Deployment() as deployment:
                self._note_reign(deployment.authority.epoch, envelope.sender, now_s)
                if self.deployment is None or _later(deployment, self.deployment):
                    self.deployment = deployment

    def leader(self, now_s: float) -> str | None:
        """Who has been heard to lead within the last lease, if anybody has."""
        return self._reign[1] if now_s - self._reigned_at_s < LEASE_S else None

    def status(self, now_s: float) -> Status:
        """The team now. O(n²) lines of sight for n peers."""
        peers = tuple(self._peer(entry.name, now_s) for entry in self.mission.roster)
        placed = [(peer.name, peer.position) for peer in peers if peer.up and peer.position is not None]
        names = [name for name, _ in placed]
        seen = np.zeros((0, 0), dtype=bool)
        if placed:
            seen = self.environment.visibility_matrix(np.array([position for _, position in placed]))
        base, agent = self.mission.base_station.name, self.mission.tracked_agent.name
        visible: bool | None = False
        connected = False
        target = None
        if self.estimate is not None:
            deque(self.estimate.handle(Woken((0.0, 0.0)), now_s), maxlen=0)
            target = self.estimate.target(now_s)
            visible = None
            chain = [base, *(placement.robot for placement in self._relays())]
            connected = all(name in names for name in chain) and _joined(seen, [names.index(name) for name in chain])
        elif agent in names:
            j = names.index(agent)
            visible = bool(seen[j].sum() > 1)
            connected = base in names and chain_connected(seen, names.index(base), j)
        return Status(
            peers=peers,
            goal=self.goal,
            deployment=self.deployment,
            leader=self.leader(now_s),
            estimate=target,
            agent_visible=visible,
            chain_connected=connected,
            links=int((seen.sum() - len(placed)) // 2),
        )

    def _relays(self) -> tuple[Placement, ...]:
        placements = self.deployment.placements if self.deployment else ()
        return tuple(placement for placement in placements if not placement.spare)

    def _note_reign(self, epoch: int, leader: str, now_s: float) -> None:
        """A leader in office has spoken; an earlier reign that goes on speaking does not count."""
        if epoch >= self._reign[0]:
            self._reign, self._reigned_at_s = (epoch, leader), now_s

    def _peer(self, name: str, now_s: float) -> PeerStatus:
        known = self._known[name]
        up = known.spoke and known.token and now_s - known.heard_at_s < SILENT_AFTER_S
        mode = known.mode if up or not known.spoke else "lost"
        return PeerStatus(name, up, mode, known.position, known.obeying)


def _joined(seen: NDArray[np.bool_], chosen: Sequence[int]) -> bool:
    """Whether all chosen rows are one network, over any others."""
    return all(chain_connected(seen, chosen[0], other) for other in chosen[1:])


def _later(new: Deployment, old: Deployment) -> bool:
    return (new.authority.epoch, new.authority.sequence) > (old.authority.epoch, old.authority.sequence)

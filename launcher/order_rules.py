"""Rules on orders and on what robots do by them: who may give one, when it may be taken, how far it lets anybody go."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final, Protocol

from agents.auction import Auctioneer
from agents.motion_message import end_stage, piece
from agents.robot import Robot
from agents.standing_orders import StandingOrders
from agents.topology import TeamTree
from launcher.simulated_peer import SimulatedPeer, holds_lease
from launcher.violation import Violation
from protocol.messages import (
    Auction,
    Authority,
    Deployment,
    Envelope,
    MemberWay,
    Motion,
    Progress,
    State,
    Topology,
    Warrant,
)

REMEMBERED_S: Final = 30.0
"""Orders are remembered for so long; none can be taken that is older."""

REMEMBERED: Final = 200
"""Motions."""

OFF_M: Final = 0.02
"""Bodies are no farther than this from their ways."""

ROUNDING_S: Final = 1e-6


class Holder(Protocol):
    """Part of a mind that takes orders of one kind."""

    @property
    def latest(self) -> Deployment | Topology | Auction | None:
        """The last that was taken."""


@dataclass(slots=True)
class _Hand:
    """What a process has in hand of orders of one kind."""

    kind: str
    holder: Holder
    seen: object = None
    """The last that was looked at."""


HOLDERS: Final[Mapping[str, tuple[type[object], Callable[[Any], Holder]]]] = {
    "deployment": (StandingOrders, lambda part: part),
    "topology": (TeamTree, lambda part: part.held),
    "auction": (Auctioneer, lambda part: part),
}
"""By kind of order: which part of a mind takes it, and what that part says of it."""


class OrderRules:
    """Orders are given within a lease only, taken while the lease runs that they were given in, and in their order.

    Args:
        keeps_disks: whether no disk is lost; otherwise epochs may begin again, and with them the order.
    """

    def __init__(self, keeps_disks: bool) -> None:
        self._keeps_disks = keeps_disks
        self._given: dict[tuple[str, int, str, int], float] = {}
        """By kind, epoch, leader and sequence: when the lease ends that they were given in, by true time."""
        self._taken: dict[tuple[str, str], Authority] = {}
        """The last of each kind that each peer took."""
        self._hands: dict[str, tuple[object, list[_Hand]]] = {}
        """By peer: its present role, and what that holds."""

    def hear(self, peer: SimulatedPeer, envelope: Envelope) -> None:
        """Who says what bears a warrant must hold a lease."""
        body = envelope.body
        if not isinstance(getattr(body, "warrant", None), Warrant):
            return
        if not holds_lease(peer):
            raise Violation("orders are given within a lease", f"{peer.name} says {envelope.kind} without one")
        if isinstance(body, Deployment | Topology | Auction) and peer.allegiance is not None:
            authority = body.authority
            ends_s = peer.clock.when(peer.allegiance.election.lease_until_s)
            self._given[envelope.kind, authority.epoch, authority.leader, authority.sequence] = ends_s
            self._forget(ends_s - REMEMBERED_S)

    def look(self, peer: SimulatedPeer) -> None:
        """What it has taken last must be in time, and later than what it took before."""
        role, hands = self._hands.get(peer.name, (None, ()))
        if role is not peer.role:
            hands = self._look_for(peer)
        for hand in hands:
            latest = hand.holder.latest
            if latest is not hand.seen and latest is not None:
                hand.seen = latest
                self._judge(peer, hand.kind, latest.authority)

    def _look_for(self, peer: SimulatedPeer) -> list[_Hand]:
        """Where a process that has just begun keeps what it takes."""
        parts = ((kind, peer.part(part), holder) for kind, (part, holder) in HOLDERS.items())
        hands = [_Hand(kind, holder(part)) for kind, part, holder in parts if part is not None]
        self._hands[peer.name] = peer.role, hands
        return hands

    def _judge(self, peer: SimulatedPeer, kind: str, authority: Authority) -> None:
        before = self._taken.get((peer.name, kind))
        self._taken[peer.name, kind] = authority
        what = f"{peer.name} takes {kind} {_order(authority)}"
        if before is not None and self._keeps_disks and _order(authority) <= _order(before) and authority != before:
            raise Violation("no older order after a newer one", f"{what} after {_order(before)}")
        ends_s = self._given.get((kind, authority.epoch, authority.leader, authority.sequence))
        if ends_s is None:
            raise Violation("orders taken have been given", f"{what}, which nobody gave")
        late_s = peer.true_s - ends_s
        if late_s > ROUNDING_S:
            text = f"{what} {late_s:.3f} s after the lease that it was given in"
            raise Violation("no order is taken when its lease has ended", text)

    def _forget(self, before_s: float) -> None:
        while self._given and (first := next(iter(self._given))) and self._given[first] < before_s:
            del self._given[first]


class MotionRules:
    """Robots go where and as far as was ordered, never ahead of each other, and only while they obey, or back together.

    Args:
        peers: of the team, by name.
    """

    def __init__(self, peers: Mapping[str, SimulatedPeer]) -> None:
        self._peers = peers
        self._motions: dict[tuple[int, int, int], Motion] = {}
        """By epoch, plan and revision, as ordered first."""
        self._released: dict[tuple[int, int], int] = {}
        """The last stage that each plan of an epoch lets anybody begin."""
        self._settled: dict[tuple[int, int, int], int] = {}
        """By epoch, plan and revision: the last stage that was released before that."""
        self._progress: dict[str, tuple[int, Progress]] = {}
        """What each robot said last, and its incarnation."""
        self._finished: dict[tuple[str, int, int], int] = {}
        """By robot, epoch and plan: stages that it said last to have finished, whatever it has followed since."""

    def hear(self, peer: SimulatedPeer, envelope: Envelope) -> None:
        """Remember what is ordered; hold what robots say of themselves against it, and against where they truly are."""
        body = envelope.body
        if isinstance(body, Deployment) and body.motion is not None:
            epoch, motion = body.authority.epoch, body.motion
            self._motions.setdefault((epoch, motion.plan, motion.revision), motion)
            key, known = (epoch, motion.plan), (epoch, motion.plan, motion.revision)
            released = self._released.get(key, motion.first_stage - 1)
            self._settled.setdefault(known, released)
            if motion.released > self._settled[known]:
                self._judge_release(epoch, motion)
            self._released[key] = max(released, motion.released)
            if len(self._motions) > REMEMBERED:
                first = next(iter(self._motions))
                del self._motions[first], self._settled[first]
        elif isinstance(body, State) and body.progress is not None:
            self._judge(peer, envelope.incarnation, body.progress, moves=body.velocity != (0.0, 0.0))

    def look(self, peer: SimulatedPeer) -> None:
        """No body moves for longer than its mind obeys, but back."""
        if peer.allegiance is None or peer.drives_until_s <= peer.true_s:
            return
        _, progress = self._progress.get(peer.name, (-1, None))
        if progress is not None and progress.retreat is not None:
            self._judge_retreat(peer.name, progress, progress.retreat)
            return
        late_s = peer.drives_until_s - peer.clock.when(peer.allegiance.election.obedience.until_s)
        if late_s > ROUNDING_S:
            raise Violation("nobody moves who obeys nobody", f"{peer.name} is to drive {late_s:.3f} s longer")

    def _judge_release(self, epoch: int, motion: Motion) -> None:
        """Whether all robots have accepted what is released: in this revision, or the same in the one they follow."""
        for way in motion.ways:
            peer = self._peers.get(way.member)
            if not way.scheduled or peer is None or peer.part(Robot) is None:
                continue
            _, last = self._progress.get(way.member, (-1, None))
            accepted = None
            if last is not None and (last.epoch, last.plan) == (epoch, motion.plan):
                accepted = self._motions.get((epoch, last.plan, last.revision))
            if accepted is None or not agree(accepted, motion):
                text = f"stage {motion.released} of revision {motion.revision}, and {way.member} has not accepted it"
                raise Violation("nothing is released before all have accepted it", text)

    def _judge(self, peer: SimulatedPeer, incarnation: int, progress: Progress, *, moves: bool) -> None:
        name = peer.name
        before_incarnation, before = self._progress.get(name, (-1, None))
        self._progress[name] = (incarnation, progress)
        self._finished[name, progress.epoch, progress.plan] = progress.finished
        if before is not None and before_incarnation == incarnation and _steps(progress) < _steps(before):
            raise Violation("nobody goes back", f"{name} goes from {_steps(before)} to {_steps(progress)}")
        motion = self._motions.get((progress.epoch, progress.plan, progress.revision))
        if motion is None:
            raise Violation("motions accepted were ordered", f"{name} follows {_steps(progress)}, which nobody ordered")
        way = next((way for way in motion.ways if way.member == name), None)
        if way is None:
            raise Violation("motions accepted are one's own", f"{name} has no way in {_steps(progress)}")
        if progress.retreat is None:
            self._judge_place(peer, way, motion, progress, moves=moves)

    def _judge_retreat(self, name: str, progress: Progress, stage: int) -> None:
        """Whether all that were in the motion have turned, and none has more than a stage left to come back through."""
        motion = self._motions.get((progress.epoch, progress.plan, progress.revision))
        for way in () if motion is None else motion.ways:
            _, known = self._progress.get(way.member, (-1, None))
            if way.scheduled and known is not None and way.member != name:
                if (known.epoch, known.plan) == (progress.epoch, progress.plan) and known.retreat is None:
                    raise Violation("nobody goes back before all have turned", f"{name} before {way.member}")
                if known.retreat is not None and known.retreat > stage + 1:
                    text = f"{name} goes back before stage {stage}, {way.member} has come back to {known.retreat}"
                    raise Violation("nobody goes back ahead of those who are farther", text)

    def _judge_place(
        self, peer: SimulatedPeer, way: MemberWay, motion: Motion, progress: Progress, *, moves: bool
    ) -> None:
        """Whether the body is where its progress lets it be."""
        stage, place = progress.finished - motion.first_stage, peer.place
        if not 0 <= stage <= end_stage(motion) - motion.first_stage:
            return  # a later message had the rest of it
        onset = way.waypoints[way.stages[stage]]
        if math.dist(place, onset) <= OFF_M and not moves:
            return
        name, number = peer.name, progress.finished
        if number == end_stage(motion) or _distance(place, piece(way, stage)) > OFF_M:
            raise Violation("everybody is on their way", f"{name} is at {place}, off stage {number}")
        if number > self._released[progress.epoch, progress.plan]:
            raise Violation("nobody goes beyond what is released", f"{name} is in stage {number}")
        for other in motion.ways:
            if other.member == name or not other.scheduled or other.member not in self._peers:
                continue
            finished = self._finished.get((other.member, progress.epoch, progress.plan), 0)
            behind = range(max(finished, motion.first_stage), number - 1)
            if any(other.stages[n - motion.first_stage] < other.stages[n - motion.first_stage + 1] for n in behind):
                text = f"{name} is in stage {number}, {other.member} has finished {finished}"
                raise Violation("nobody is two stages ahead", text)


def agree(one: Motion, other: Motion) -> bool:
    """Whether two revisions have the same stages, as far as the second is released and the first reaches back."""
    if one.revision == other.revision:
        return True
    if end_stage(one) <= other.released:
        return False
    ways = {way.member: way for way in one.ways}
    return all(
        piece(ways[way.member], stage - one.first_stage) == piece(way, stage - other.first_stage)
        for way in other.ways
        if way.scheduled
        for stage in range(max(one.first_stage, other.first_stage), other.released + 1)
    )


def _order(authority: Authority) -> tuple[int, int]:
    return authority.epoch, authority.sequence


def _steps(progress: Progress) -> tuple[int, int, int, int]:
    return progress.epoch, progress.plan, progress.revision, progress.finished


def _distance(place: tuple[float, float], path: tuple[tuple[float, float], ...]) -> float:
    """Of a place from a path, metres."""
    least = math.dist(place, path[0])
    for (ax, ay), (bx, by) in pairwise(path):
        dx, dy = bx - ax, by - ay
        along = ((place[0] - ax) * dx + (place[1] - ay) * dy) / ((dx * dx + dy * dy) or 1.0)
        share = min(1.0, max(0.0, along))
        least = min(least, math.dist(place, (ax + share * dx, ay + share * dy)))
    return least

"""The leader's orders as this peer has taken them: the last deployment, and whether it is in force.

Every deployment is judged here, once, also the peer's own; all parts of its mind go by the same orders.
"""

from __future__ import annotations

from collections.abc import Iterable

from agents.allegiance import Allegiance
from agents.records import LogLine, Taken
from agents.role import Effect, Event, Heard, Record
from protocol.messages import Deployment, Reign

KIND = "deployment"


class StandingOrders:
    """See the module.

    Args:
        allegiance: says whose orders count.
    """

    hears = frozenset({KIND})
    next_s = float("inf")

    def __init__(self, allegiance: Allegiance) -> None:
        self.latest: Deployment | None = None
        """The last that was taken, in force or not: what the team was last told, as far as this peer knows."""
        self._allegiance = allegiance
        self._reign: Reign | None = None
        self._refused: tuple[str, str] = ("", "")
        """Sender and reason of what was refused last."""

    def in_force(self, now_s: float) -> Deployment | None:
        """What to do; None: hold, since nobody is obeyed, or who is has not ordered anything yet."""
        reign = self._allegiance.obeyed(now_s)
        return self.latest if reign is not None and reign == self._reign else None

    def give(self, orders: Deployment, now_s: float) -> str:
        """Judge orders of this peer itself; empty if they are taken."""
        return self._judge(orders, self._allegiance.name, self._allegiance.incarnation, now_s)

    def handle(self, event: Event, now_s: float) -> Iterable[Effect]:
        """Take what is heard, or say why not; the same only once. What is merely overtaken is not worth a word."""
        if not isinstance(event, Heard) or not isinstance(event.envelope.body, Deployment):
            return ()
        envelope, orders = event.envelope, event.envelope.body
        before, overtaken = self.latest, self._reign == _reign(orders, envelope.sender, envelope.incarnation)
        refusal = self._judge(orders, envelope.sender, envelope.incarnation, now_s)
        if not refusal and not (overtaken and before is not None and _what(before) == _what(orders)):
            return (Record(_describe(orders, envelope.sent_at_s)),)
        if not refusal or overtaken or (envelope.sender, refusal) == self._refused:
            return ()
        self._refused = envelope.sender, refusal
        text = f"does not take the orders of {envelope.sender} in epoch {orders.authority.epoch}: they are {refusal}"
        return (Record(LogLine(level="info", text=text)),)

    def _judge(self, orders: Deployment, sender: str, incarnation: int, now_s: float) -> str:
        refusal = self._allegiance.take(KIND, orders.authority, sender, incarnation, orders.warrant, now_s)
        if not refusal:
            self.latest, self._reign = orders, _reign(orders, sender, incarnation)
            self._refused = ("", "")
        return refusal


def _what(orders: Deployment) -> tuple[int, tuple[int, int] | None]:
    """Decision, and plan and revision of the motion: what repetitions have in common."""
    motion = orders.motion
    return orders.decision, None if motion is None else (motion.plan, motion.revision)


def _describe(orders: Deployment, sent_at_s: float) -> Taken:
    """Orders that have been taken, for the recording."""
    decision, motion = _what(orders)
    authority = orders.authority
    return Taken(
        epoch=authority.epoch, leader=authority.leader, sequence=authority.sequence, decision=decision, motion=motion,
        lease_s=orders.warrant.lease_s, sent_at_s=sent_at_s,
    )  # fmt: skip


def _reign(orders: Deployment, sender: str, incarnation: int) -> Reign:
    """Who says to have given them."""
    return Reign(epoch=orders.authority.epoch, leader=sender, incarnation=incarnation)

"""An allegiance that believes every leader, so that tests of what obeys orders need no election."""

from __future__ import annotations

from agents.allegiance import Allegiance
from agents.standing_orders import StandingOrders
from protocol.membership import Presence
from protocol.messages import Authority, Reign, Warrant

ORDER_LASTS_S = 3.0


class Sworn(Allegiance):
    """Obeys the order with the greatest (epoch, sequence), for three seconds from when it was heard."""

    def __init__(self, name: str, incarnation: int = 0) -> None:
        self.name, self.incarnation = name, incarnation
        self.office: Reign | None = None
        self._last: Reign | None = None
        self._until_s = float("-inf")
        self._order = (-1, -1)
        self.gone: set[str] = set()

    @property
    def reign(self) -> Reign | None:
        return self.office

    @property
    def followed(self) -> Reign | None:
        return self._last

    @property
    def obeyed_until_s(self) -> float:
        return self._until_s

    def leads(self, _now_s: float) -> bool:
        return self.office is not None

    def obeyed(self, now_s: float) -> Reign | None:
        return self._last if now_s < self._until_s else None

    def warrant(self, _now_s: float) -> Warrant | None:
        return None if self.office is None else Warrant(lease_s=1.0, marks=())

    def presence(self, peer: str) -> Presence:
        return Presence.GONE if peer in self.gone else Presence.PRESENT

    def is_there(self, peer: str, _incarnation: int) -> bool:
        return peer not in self.gone

    def take(
        self, _kind: str, authority: Authority, sender: str, incarnation: int, _warrant: Warrant, now_s: float
    ) -> str:
        order = (authority.epoch, authority.sequence)
        if order <= self._order:
            return "older than an order taken before"
        self._order = order
        self._last = Reign(epoch=authority.epoch, leader=sender, incarnation=incarnation)
        self._until_s = now_s + ORDER_LASTS_S
        return ""


def sworn(name: str) -> tuple[Sworn, StandingOrders]:
    """An allegiance, and the orders taken by it."""
    allegiance = Sworn(name)
    return allegiance, StandingOrders(allegiance)

"""From plans to standing orders, and what makes a plan a new decision."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from msgspec import structs

from protocol.messages import Authority, Deployment, Warrant

if TYPE_CHECKING:
    from agents.leader import Plan

Links = set[frozenset[object]]


def first_orders(leader: str) -> Deployment:
    """What is said before there is a plan: to hold."""
    return Deployment(
        authority=Authority(epoch=0, leader=leader, sequence=0), warrant=Warrant(lease_s=0.0, marks=()),
        decision=0, placements=(), edges=(), cost=0.0, relays_needed=0,
        reason="everybody holds before the first plan",
    )  # fmt: skip


def plan_of(orders: Deployment, agent: str) -> Plan | None:
    """The plan that orders come from, as far as they tell, for a leader that did not make it; None before the first."""
    from agents.leader import Plan  # its imports take a quarter of a second

    if orders.decision == 0:
        return None
    return Plan(
        placements=orders.placements,
        edges=orders.edges,
        cost=orders.cost,
        relays_needed=orders.relays_needed,
        serves=any(agent in edge for edge in orders.edges),
        reason=orders.reason,
        total_cost_m=orders.total_cost_m,
        lower_bound_m=orders.lower_bound_m,
    )


def renew(orders: Deployment, plan: Plan, *, decides: bool) -> Deployment:
    """The orders with the places of a plan, as a new decision or as the old one; the rest is set when it is said."""
    return structs.replace(
        orders,
        decision=orders.decision + decides,
        placements=plan.placements,
        edges=plan.edges,
        cost=_finite(plan.cost) or 0.0,
        total_cost_m=_finite(plan.total_cost_m),
        lower_bound_m=_finite(plan.lower_bound_m),
        relays_needed=plan.relays_needed,
        reason=plan.reason[:500] if decides else orders.reason,
        motion=None,
    )


def is_decision(plan: Plan, before: Plan | None) -> bool:
    """Whether links, or places of relays, are new. Places of spares do not count."""
    return before is None or _choice(plan) != _choice(before)


def changes_topology(plan: Plan, before: Plan | None) -> bool:
    """Whether the links are new, and not only who stands where."""
    if before is None:
        return False
    (names, places), (old_names, old_places) = _links(plan), _links(before)
    return names != old_names and places != old_places


def _choice(plan: Plan) -> tuple[object, ...]:
    return plan.edges, [placement for placement in plan.placements if not placement.spare]


def _links(plan: Plan) -> tuple[Links, Links]:
    """Who is linked with whom, and which places are."""
    places = {placement.robot: placement.position for placement in plan.placements}
    return (
        {frozenset(edge) for edge in plan.edges},
        {frozenset(places.get(name, name) for name in edge) for edge in plan.edges},
    )


def _finite(number: float | None) -> float | None:
    """The number, or None: JSON has no infinity."""
    return number if number is not None and math.isfinite(number) else None

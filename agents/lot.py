"""What is auctioned: all that a bidder must know to look for chains as the leader would, on the wire and off it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from agents.whereabouts import Aim
from protocol import messages
from protocol.messages import Auction, Authority, Offer, Placement, Point, Warrant

ROUNDING: Final = 1e-6
"""The shares of an aim add up to 1 but for this."""


@dataclass(frozen=True, eq=False)
class Lot:
    """A team, its chain, and what another chain may be for."""

    center: Point
    """In the middle of where the agent is."""
    aims: tuple[Aim, ...]
    robots: Mapping[str, Point]
    """Where they are, in free space."""
    standing: tuple[str, ...]
    """The relays of the chain that there is, from the base outward."""
    obstacles: tuple[Point, ...] = ()
    """Where nobody can stand."""


@dataclass(frozen=True, eq=False)
class Bids:
    """What came of an auction."""

    aims: tuple[Aim, ...]
    """Of the lot: offers are numbered by these."""
    offers: Mapping[str, Sequence[Offer]]
    """By bidder."""


def to_auction(lot: Lot, number: int, authority: Authority, warrant: Warrant) -> Auction:
    """The message."""
    return Auction(
        authority=authority,
        warrant=warrant,
        auction=number,
        center=lot.center,
        aims=tuple(
            messages.Aim(
                places=tuple((float(x), float(y)) for x, y in aim.places),
                shares=tuple(min(1.0, float(share)) for share in aim.shares),
                ahead_m=aim.ahead_m,
            )
            for aim in lot.aims
        ),
        robots=tuple(Placement(robot=name, position=place) for name, place in lot.robots.items()),
        standing=lot.standing,
        obstacles=lot.obstacles,
    )


def from_auction(auction: Auction) -> Lot:
    """The lot of a message.

    Raises:
        ValueError: an aim has more places than shares or fewer, or its shares are not of sum 1; or the chain has a
            relay of which no place is said, or one twice.
    """
    robots = {placement.robot: placement.position for placement in auction.robots}
    if unknown := [name for name in auction.standing if name not in robots]:
        raise ValueError(f"{unknown[0]} is a relay of the chain, and its place is not said")
    if len(set(auction.standing)) < len(auction.standing):
        raise ValueError("a robot is twice a relay of the chain")
    aims = []
    for aim in auction.aims:
        if len(aim.places) != len(aim.shares):
            raise ValueError(f"an aim has {len(aim.places)} places and {len(aim.shares)} shares: give as many")
        if abs(sum(aim.shares) - 1.0) > ROUNDING:
            raise ValueError(f"the shares of an aim add up to {sum(aim.shares):g} and not to 1")
        aims.append(Aim(np.array(aim.places), np.array(aim.shares), aim.ahead_m, "", ""))
    return Lot(auction.center, tuple(aims), robots, auction.standing, auction.obstacles)

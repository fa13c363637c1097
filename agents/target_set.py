"""Where an agent that tells nobody its place may be, as planning and pictures need it."""

from __future__ import annotations

from dataclasses import dataclass

from protocol.messages import Point


@dataclass(frozen=True, slots=True)
class TargetSet:
    """The set that contains the agent, in samples and outlines. Metres, map frame.

    A picture of the set, not the set: whether a point is in it is asked of what made it
    (:meth:`agents.shared_estimate.SharedEstimate.contains`).
    """

    time_s: float
    """Mission time at which the set holds; later it is larger by what the agent can walk."""
    center: Point
    """The sample whose farthest sample is nearest: inside the set, and in free space."""
    samples: tuple[Point, ...]
    """Of the set: corners of its pieces and a grid inside, all in free space; never empty."""
    rings: tuple[tuple[Point, ...], ...]
    """Outlines for pictures: of its pieces, counter-clockwise; they may reach beyond free space."""
    area_m2: float
    """Of the pieces, before walls are cut off."""
    newest_s: float
    """Time of the newest range in it."""

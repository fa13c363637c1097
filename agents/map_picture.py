"""A picture of a map's free space and cells, for viewers that cannot fill polygons."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

if TYPE_CHECKING:
    from planning.environment import Environment

Floats: TypeAlias = NDArray[np.float64]
Colour: TypeAlias = tuple[int, int, int]

LONG_SIDE_PIXELS = 1200
_SUPERSAMPLING = 2
_MARGIN_PIXELS = 2

OBSTACLE: Colour = (16, 18, 22)
"""Colour of what is not free space; a view that shows the picture has the same background."""
_FREE: Colour = (52, 58, 68)
_CELL_TINTS: tuple[Colour, ...] = ((47, 53, 63), (52, 58, 68), (57, 64, 74), (50, 59, 66), (56, 60, 72))


@dataclass(frozen=True, slots=True)
class MapPicture:
    """A PNG whose row 0 lies at the *lowest* y, and where it belongs."""

    png: bytes
    origin: tuple[float, float]
    """Outer corner of pixel (0, 0): lowest x and y, metres, map frame."""
    metres_per_pixel: float


def draw_map(environment: Environment, cell_polygons: Sequence[Floats] = ()) -> MapPicture:
    """Free space filled, and the cells told apart by slightly different tints.

    Args:
        environment: the map.
        cell_polygons: (m, 2) float rings, metres, map frame; may be empty.

    The longer side of the bounds takes :data:`LONG_SIDE_PIXELS`. Linear in pixels and vertices; about 0.1 s.
    """
    x_min, y_min, x_max, y_max = environment.bounds
    scale = max(x_max - x_min, y_max - y_min) / LONG_SIDE_PIXELS
    origin = np.array([x_min, y_min]) - _MARGIN_PIXELS * scale
    width, height = (
        _SUPERSAMPLING * (int(np.ceil(extent / scale)) + 2 * _MARGIN_PIXELS)
        for extent in (x_max - x_min, y_max - y_min)
    )

    def in_pixels(ring: Floats) -> list[tuple[float, float]]:
        pixels = (np.asarray(ring) - origin) * (_SUPERSAMPLING / scale)
        return [(float(x), float(y)) for x, y in pixels]

    image = Image.new("RGB", (width, height), OBSTACLE)
    brush = ImageDraw.Draw(image)
    brush.polygon(in_pixels(environment.outer), fill=_FREE)
    for number, ring in enumerate(cell_polygons):
        brush.polygon(in_pixels(ring), fill=_CELL_TINTS[number % len(_CELL_TINTS)])
    for hole in environment.holes:
        brush.polygon(in_pixels(hole), fill=OBSTACLE)

    buffer = io.BytesIO()
    image.reduce(_SUPERSAMPLING).save(buffer, format="PNG")
    return MapPicture(buffer.getvalue(), (float(origin[0]), float(origin[1])), scale)

"""Occupancy grids of ROS (`map_server`: a YAML file beside an image) as polygonal environments.

The free cells that hang together by their sides, as ROS' map_server reads them, become a polygon with holes. Four
things are done to them, in this order, and no more:

- *Specks* go: occupied or unknown cells that hang together, sides or corners, amid free ones, and cover no more than
  `SPECK_AREA_M2` (10 cm by 10 cm), become free. On a grid coarser than 0.1 m a cell nothing is a speck.
- *Crannies* are filled: slits between boards, the inside of pallets, cracks in a wall, wherever no disc with the
  tolerance for a radius gets near. A passage narrower than twice the tolerance may be closed with them, and what
  lies behind it is another component then.
- Where two free cells meet in a corner only, one of them goes, so that walls never touch themselves.
- The outline loses corners, from the inside only: no point of the polygon lies in a cell that is not free, and every
  point that the outline cut off lies within the tolerance of such a cell, as does every cranny.

Free specks, and rooms seen through a window, are other components: they are no part of the environment. The tolerance
is two cells unless told; it is written into the environment's `source`.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import ArrayLike, NDArray
from PIL import Image
from scipy import ndimage

from planning.environment import Environment
from planning.grid_outline import Booleans, Floats, outline, without_pinches

SPECK_AREA_M2 = 0.01
"""Largest speck of occupied or unknown cells that is taken for noise."""

TOLERANCE_CELLS = 2
"""How far from a wall the outline may be cut short, in cells, unless told."""

_MODES = ("trinary", "scale", "raw")


class BadGrid(ValueError):
    """A grid that cannot be read or used; the text says file, place and remedy in one sentence."""


def load_occupancy_grid(
    path: str | Path, containing: ArrayLike | None = None, tolerance_m: float | None = None
) -> Environment:
    """Environment of a ROS occupancy grid, in metres in the grid's map frame, named after the file.

    Args:
        path: the YAML file, with `image` (PGM or PNG, relative to it), `resolution` [m per cell], `origin` [x, y, yaw]
            of the lower left corner, `negate`, `occupied_thresh`, `free_thresh` and, if not trinary, `mode`.
            Unknown cells are not free; neither are the cells in between of mode `scale`. In mode `raw` a shade is
            an occupancy in percent, free below `free_thresh`, and `negate` has no effect (as in Nav2).
        containing: (2,) metres: the component that holds this point is meant, instead of the largest. Its cell is
            never cut off by the simplification.
        tolerance_m: how far from a wall the outline may be cut short; at least one cell, two unless told. The coarser,
            the fewer corners, and the fewer cells to plan on; keep it below the radius of the robots.

    Raises:
        BadGrid: what is wrong, and where.
    """
    path = Path(path)
    header = _Header(path)
    if tolerance_m is None:
        tolerance_m = TOLERANCE_CELLS * header.resolution_m
    tolerance = tolerance_m / header.resolution_m + 1e-9
    if not 1 <= tolerance < math.inf:
        raise BadGrid(
            f"{path}: the tolerance of {tolerance_m} m is no length, or finer than the grid: "
            f"give at least its resolution, {header.resolution_m} m"
        )
    free = _without_specks(header.free_cells(), SPECK_AREA_M2 / header.resolution_m**2)
    if not free.any():
        raise BadGrid(f"{path}: the grid has no free cell: check 'negate', 'free_thresh' and 'mode' against the image")
    depth: Floats = ndimage.distance_transform_edt(np.pad(free, 1))[1:-1, 1:-1]
    cell = None if containing is None else header.cell_at(np.asarray(containing, dtype=float), free)
    if cell is not None:
        depth[cell] = np.inf
    spacious = _without_crannies(free, depth, tolerance)
    if not spacious.any():
        raise BadGrid(
            f"{path}: the free floor is nowhere wider than twice the tolerance of {tolerance_m:g} m: "
            f"give a smaller one, at least the resolution of {header.resolution_m} m"
        )
    free = _component(without_pinches(_component(spacious, cell), depth), cell)
    if containing is not None and np.count_nonzero(free & (depth > tolerance)) == 1:
        raise BadGrid(
            f"{path}: {_name(containing)} is in a cranny no wider than twice the tolerance of {tolerance_m:g} m: "
            "choose a point on open floor, or give a smaller tolerance"
        )
    rings = [header.to_map(ring) for ring in outline(free, depth, tolerance)]
    source = f"occupancy grid {path.name}, outline within {tolerance_m:g} m of its walls"
    return Environment(rings[0], rings[1:], name=path.stem, source=source)


class _Header:
    """The YAML file of a grid, checked."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            keys = yaml.safe_load(path.read_text(encoding="utf-8"))
        except OSError as fault:
            raise BadGrid(f"{path}: cannot be read ({fault.strerror}): give the .yaml file of a grid") from None
        except (yaml.YAMLError, ValueError, OverflowError, RecursionError) as fault:
            where = getattr(fault, "problem_mark", None)
            place = "" if where is None else f", line {where.line + 1}"
            raise BadGrid(
                f"{path}{place}: this is no readable YAML: give the .yaml file of a grid, not its image"
            ) from None
        if not isinstance(keys, dict):
            raise BadGrid(f"{path}: there are no keys: a grid's .yaml says 'image: map.pgm', 'resolution: 0.05', ...")
        self._keys = keys
        self.resolution_m = self._number("resolution", "metres per cell, e.g. 0.05")
        if not 1e-4 <= self.resolution_m <= 1e3:
            raise self._refusal("resolution", "a positive number of metres per cell, 0.0001 to 1000, e.g. 0.05")
        origin = self._key("origin", "the lower left corner, [x, y, yaw]")
        numbers = origin if isinstance(origin, list) else []
        if len(numbers) != 3 or not all(_is_number(number) for number in numbers):
            raise self._refusal("origin", "three numbers, [x, y, yaw] in metres and radians")
        x, y, yaw = (float(number) for number in numbers)
        self._corner = np.array([x, y])
        self._turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
        self._negate = self._key("negate", "0 or 1")
        if self._negate not in (0, 1):
            raise self._refusal("negate", "0 (white is free) or 1 (black is free)")
        self._free_below = self._number("free_thresh", "from 0 to 1, e.g. 0.196")
        self._occupied_above = self._number("occupied_thresh", "from 0 to 1, e.g. 0.65")
        if not 0 <= self._free_below < self._occupied_above <= 1:
            raise BadGrid(
                f"{path}: keys 'free_thresh' {self._free_below} and 'occupied_thresh' {self._occupied_above} must lie "
                "between 0 and 1, the first below the second, e.g. 0.196 and 0.65"
            )
        self._mode = keys.get("mode", "trinary")
        if self._mode not in _MODES:
            raise self._refusal("mode", "one of " + ", ".join(_MODES))
        image = self._key("image", "the image's file name")
        if not isinstance(image, str) or not image:
            raise self._refusal("image", "the image's file name, e.g. map.pgm")
        self._image = path.parent / image

    def free_cells(self) -> Booleans:
        """Cells that are free by the rules of map_server: (h, w) bool, the lowest row first."""
        colours, opacity = self._pixels()
        if self._mode == "raw":
            percent = np.rint(colours.mean(axis=2) * 255)
            below: Booleans = percent < self._free_below * 100
            return below[::-1]
        channels = colours
        if self._mode == "trinary" and opacity is not None:
            channels = np.concatenate([colours, opacity[:, :, None]], axis=2)
        shade = channels.mean(axis=2)
        free: Booleans = (shade if self._negate else 1 - shade) < self._free_below
        if self._mode == "scale" and opacity is not None:
            free &= opacity == 1
        return free[::-1]

    def _pixels(self) -> tuple[Floats, Floats | None]:
        """Colours (h, w, 3) and, where the image has it, opacity (h, w), all from 0 to 1, the highest row first."""
        try:
            with Image.open(self._image) as image:
                if image.mode.startswith("I"):
                    return np.asarray(image, dtype=float)[:, :, None].repeat(3, axis=2) / 65535, None
                has_alpha = image.has_transparency_data
                pixels = np.asarray(image.convert("RGBA"), dtype=float) / 255
        except FileNotFoundError:
            raise BadGrid(
                f"{self.path}: the image '{self._image}' does not exist: put it there, or correct the key 'image'"
            ) from None
        except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as fault:
            raise BadGrid(
                f"{self._image}: this image cannot be read ({fault}): save the grid again as .pgm or .png"
            ) from None
        return pixels[:, :, :3], pixels[:, :, 3] if has_alpha else None

    def to_map(self, lattice: NDArray[np.int64]) -> Floats:
        """Map coordinates (n, 2), metres, of lattice points (n, 2)."""
        points: Floats = self._corner + (lattice * self.resolution_m) @ self._turn.T
        return points

    def cell_at(self, point: Floats, free: Booleans) -> tuple[int, int]:
        """(row, column) of the free cell that holds a point; of those that meet in it, the first that is free."""
        x, y = (point - self._corner) @ self._turn / self.resolution_m
        for row in sorted({math.floor(y - 1e-9), math.floor(y + 1e-9)}):
            for column in sorted({math.floor(x - 1e-9), math.floor(x + 1e-9)}):
                if 0 <= row < free.shape[0] and 0 <= column < free.shape[1] and free[row, column]:
                    return row, column
        raise BadGrid(f"{self.path}: {_name(point)} is not in a free cell of the grid: choose a point on free floor")

    def _key(self, name: str, meaning: str) -> Any:
        if name not in self._keys:
            raise BadGrid(f"{self.path}: key '{name}' is missing: add '{name}: ...', {meaning}")
        return self._keys[name]

    def _number(self, name: str, meaning: str) -> float:
        value = self._key(name, meaning)
        if not _is_number(value):
            raise self._refusal(name, f"a number, {meaning}")
        return float(value)

    def _refusal(self, name: str, wanted: str) -> BadGrid:
        return BadGrid(f"{self.path}: key '{name}' is {_shorten(self._keys[name])}: make it {wanted}")


def _shorten(value: object) -> str:
    """A value as in a sentence; neither integers of thousands of digits nor deep lists can be written out."""
    try:
        text = repr(value)
    except (ValueError, RecursionError):
        return f"a {type(value).__name__} too long to write"
    return text if len(text) <= 60 else text[:57] + "..."


def _is_number(value: object) -> bool:
    """Whether YAML gave a number; it reads 5e-2, unlike 5.0e-2, as text."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return False
    try:
        return math.isfinite(float(value))
    except (ValueError, OverflowError):
        return False


def _without_specks(free: Booleans, most_cells: float) -> Booleans:
    """Free cells, and the specks amid them; what touches the image's border goes on beyond it and is none."""
    labels, count = ndimage.label(~free, structure=np.ones((3, 3)))
    small = np.bincount(labels.ravel(), minlength=count + 1) <= most_cells + 1e-9
    for border in (labels[0], labels[-1], labels[:, 0], labels[:, -1]):
        small[border] = False
    small[0] = True
    freed: Booleans = small[labels]
    return freed


def _without_crannies(free: Booleans, depth: Floats, tolerance: float) -> Booleans:
    """Free cells near those deeper than the tolerance: as near as, in a square corner, the corner is to the disc."""
    core = depth > tolerance
    if not core.any():
        return core
    spacious: Booleans = free & (ndimage.distance_transform_edt(~core) <= math.sqrt(2) * tolerance)
    return spacious


def _component(free: Booleans, cell: tuple[int, int] | None) -> Booleans:
    """Free cells joined by sides to `cell`, or, if it is None, the most there are."""
    labels, _ = ndimage.label(free)
    label = labels[cell] if cell is not None else np.bincount(labels[free]).argmax()
    joined: Booleans = labels == label
    return joined


def _name(point: ArrayLike) -> str:
    x, y = np.asarray(point, dtype=float)
    return f"({x:g}, {y:g})"

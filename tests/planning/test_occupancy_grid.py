from __future__ import annotations

import math
import os
from collections import deque
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
import yaml
from numpy.typing import NDArray
from PIL import Image

from planning import grid_outline
from planning.corner_merging import merge_corners
from planning.environment import Environment
from planning.occupancy_grid import SPECK_AREA_M2, BadGrid, load_occupancy_grid

Booleans = NDArray[np.bool_]


def write_grid(folder: Path, pixels: NDArray[Any], suffix: str = ".png", **keys: Any) -> Path:
    """A grid whose image has `pixels`, highest row first, and the usual keys unless told otherwise."""
    Image.fromarray(pixels).save(folder / f"grid{suffix}")
    usual = {
        "image": f"grid{suffix}",
        "resolution": 1.0,
        "origin": [0, 0, 0],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    }
    file = folder / "grid.yaml"
    file.write_text(yaml.safe_dump({**usual, **keys}), encoding="utf-8")
    return file


def load_cells(folder: Path, free: Booleans, tolerance: float = 1.0, **keys: Any) -> Environment:
    """The environment of free cells given lowest row first."""
    file = write_grid(folder, np.where(free[::-1], 254, 0).astype(np.uint8), **keys)
    return load_occupancy_grid(file, tolerance_m=tolerance * keys.get("resolution", 1.0))


def squares(cells: Booleans) -> shapely.Geometry:
    """The union of unit squares, (column, row) their lower left corners."""
    rows, columns = np.nonzero(cells)
    return shapely.union_all(shapely.box(columns, rows, columns + 1, rows + 1))


def flood(cells: Booleans, start: tuple[int, int]) -> Booleans:
    reached = np.zeros_like(cells)
    reached[start] = True
    queue = deque([start])
    while queue:
        row, column = queue.popleft()
        for r, c in ((row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)):
            if 0 <= r < cells.shape[0] and 0 <= c < cells.shape[1] and cells[r, c] and not reached[r, c]:
                reached[r, c] = True
                queue.append((r, c))
    return reached


def squared(cells: Booleans) -> Booleans:
    """Lower left cells of the squares of 2 x 2 cells."""
    return np.asarray(cells[:-1, :-1] & cells[1:, :-1] & cells[:-1, 1:] & cells[1:, 1:])


def largest(cells: Booleans) -> Booleans:
    parts = []
    left = cells.copy()
    while left.any():
        row, column = np.argwhere(left)[0]
        parts.append(flood(left, (int(row), int(column))))
        left &= ~parts[-1]
    return max(parts, key=lambda part: int(part.sum()))


def noise(seed: int, size: int = 26, share: float = 0.6) -> Booleans:
    """Blobs, diagonals, specks and slits: noise smoothed by one pass, then salted."""
    rng = np.random.default_rng(seed)
    raw = np.pad(rng.random((size, size)), 1, mode="edge")
    smooth = sum(raw[i : i + size, j : j + size] for i in range(3) for j in range(3)) / 9
    free = smooth < np.quantile(smooth, share)
    return np.asarray(free ^ (rng.random((size, size)) < 0.03))


def enlarged(cells: Booleans, factor: int) -> Booleans:
    """Every cell as a square of `factor` by `factor` cells."""
    return cells.repeat(factor, axis=0).repeat(factor, axis=1)


def depths(free: Booleans) -> NDArray[np.float64]:
    """Distance of every free cell's centre to that of the nearest cell that is not, in cells; 0 for those."""
    walls = np.argwhere(np.pad(~free, 1, constant_values=True)) - 1
    found = np.zeros(free.shape)
    for row, column in np.argwhere(free):
        found[row, column] = np.hypot(*(walls - (row, column)).T).min()
    return found


# What map_server calls free


def is_free(mode: str, pixel: tuple[float, float, float, float], alpha: bool, keys: dict[str, Any]) -> bool:
    """One pixel (0..255) by the rules of Nav2's map_server, written out."""
    red, green, blue, opacity = (value / 255 for value in pixel)
    shade = (red + green + blue) / 3
    if mode == "raw":
        return round(shade * 255) / 100 < keys["free_thresh"]
    if mode == "trinary" and alpha:
        shade = (red + green + blue + opacity) / 4
    if mode == "scale" and alpha and opacity < 1:
        return False
    occupied = shade if keys["negate"] else 1 - shade
    return bool(occupied < keys["free_thresh"])


@pytest.mark.parametrize("mode", ["trinary", "scale", "raw"])
@pytest.mark.parametrize("negate", [0, 1, True])
@pytest.mark.parametrize("free_thresh", [0.196, 0.25, 0.5])
def test_shades_are_read_as_map_server_reads_them(tmp_path: Path, mode: str, negate: int, free_thresh: float) -> None:
    keys = {"negate": negate, "free_thresh": free_thresh, "mode": mode}
    floor = 0 if mode == "raw" or negate else 255
    for shade in (0, 1, 19, 20, 25, 49, 51, 63, 64, 100, 127, 128, 191, 192, 204, 205, 206, 254, 255):
        pixels = np.full((16, 16), floor, dtype=np.uint8)
        pixels[6:10, 6:10] = shade
        environment = load_occupancy_grid(write_grid(tmp_path, pixels, ".pgm", **keys))
        assert (len(environment.holes) == 0) == is_free(mode, (shade, shade, shade, 255), False, keys), shade


@pytest.mark.parametrize("mode", ["trinary", "scale"])
@pytest.mark.parametrize("pixel", [(255, 255, 255, 254), (255, 255, 255, 0), (200, 255, 220, 255), (90, 250, 250, 255)])
def test_colour_and_opacity_count_as_in_map_server(tmp_path: Path, mode: str, pixel: tuple[int, int, int, int]) -> None:
    keys = {"negate": 0, "free_thresh": 0.196, "mode": mode}
    pixels = np.full((16, 16, 4), 255, dtype=np.uint8)
    pixels[6:10, 6:10] = pixel
    environment = load_occupancy_grid(write_grid(tmp_path, pixels, **keys))
    assert (len(environment.holes) == 0) == is_free(mode, pixel, True, keys)


def test_a_grey_image_with_opacity_and_one_of_16_bits_are_read(tmp_path: Path) -> None:
    free = np.zeros((8, 8), dtype=bool)
    free[1:7, 1:6] = True
    grey = np.where(free, 65535, 0).astype(np.uint16)
    assert load_occupancy_grid(write_grid(tmp_path, grey)).area == 30
    image = Image.fromarray(np.where(free, 255, 0).astype(np.uint8)).convert("LA")
    image.save(tmp_path / "grid.png")
    assert load_occupancy_grid(tmp_path / "grid.yaml").area == 30


def test_unknown_cells_are_not_free(tmp_path: Path) -> None:
    pixels = np.full((6, 12), 254, dtype=np.uint8)
    pixels[:, 5] = 205
    assert load_occupancy_grid(write_grid(tmp_path, pixels)).area == 36


# Where things are


def test_the_lowest_row_of_the_image_lies_at_the_origin(tmp_path: Path) -> None:
    pixels = np.zeros((20, 28), dtype=np.uint8)
    pixels[:6, :18] = pixels[:16, :6] = 254  # an L on its head, at the upper left of the image
    environment = load_occupancy_grid(write_grid(tmp_path, pixels, resolution=0.5, origin=[10, -3, 0]))
    wanted = shapely.union(shapely.box(10, 4, 19, 7), shapely.box(10, -1, 13, 7))
    assert environment.polygon.equals(wanted)
    assert environment.name == "grid"


def test_the_grid_is_turned_about_its_lower_left_corner(tmp_path: Path) -> None:
    pixels = np.zeros((12, 16), dtype=np.uint8)
    pixels[5:11, 3:13] = 254
    straight = load_occupancy_grid(write_grid(tmp_path, pixels)).polygon
    assert straight.equals(shapely.box(3, 1, 13, 7))
    for yaw in (math.pi / 2, 0.3, -2.0):
        file = write_grid(tmp_path, pixels, origin=[2.0, 1.0, yaw])
        turned = load_occupancy_grid(
            file, containing=(2 + 5 * math.cos(yaw + 0.5), 1 + 5 * math.sin(yaw + 0.5))
        ).polygon
        wanted = shapely.affinity.translate(shapely.affinity.rotate(straight, yaw, (0, 0), use_radians=True), 2, 1)
        assert turned.symmetric_difference(wanted).area < 1e-9


def test_the_component_is_the_largest_or_the_one_asked_for(tmp_path: Path) -> None:
    free = np.ones((9, 20), dtype=bool)
    free[:, 7] = False
    file = write_grid(tmp_path, np.where(free[::-1], 254, 0).astype(np.uint8), resolution=0.1)
    assert load_occupancy_grid(file).bounds == pytest.approx((0.8, 0, 2.0, 0.9))
    assert load_occupancy_grid(file, containing=(0.3, 0.2)).bounds == pytest.approx((0, 0, 0.7, 0.9))
    assert load_occupancy_grid(file, containing=(0.7, 0.2)).bounds[0] == 0  # on the wall's face
    for point in ((0.75, 0.2), (5.0, 0.2), (-0.2, 0.2)):
        with pytest.raises(BadGrid, match="not in a free cell"):
            load_occupancy_grid(file, containing=point)


@pytest.mark.parametrize("seed", range(12))
def test_the_point_asked_for_is_inside_or_refused_as_too_tight(tmp_path: Path, seed: int) -> None:
    free = enlarged(noise(seed, 20, share=0.75), 2)
    depth = depths(free)
    rng = np.random.default_rng(seed)
    file = write_grid(tmp_path, np.where(free[::-1], 254, 0).astype(np.uint8))
    for row, column in rng.permutation(np.argwhere(free))[:12]:
        point = (column + rng.random(), row + rng.random())
        try:
            environment = load_occupancy_grid(file, containing=point, tolerance_m=3)
        except BadGrid as refusal:
            assert "cranny" in str(refusal), seed
            assert depth[row, column] <= 3, seed
        else:
            assert environment.contains([point]).all(), seed


# What the outline may do


@pytest.mark.parametrize("tolerance", [1.0, 2.0, 3.5])
@pytest.mark.parametrize("seed", range(0, 10, 2))
def test_no_wall_is_cut_and_only_what_is_near_a_wall_is_lost(tmp_path: Path, seed: int, tolerance: float) -> None:
    free = enlarged(noise(seed, 20, share=0.55 + 0.035 * seed), math.ceil(tolerance))
    space = load_cells(tmp_path, free, tolerance).polygon
    assert squares(free).covers(space), (seed, tolerance)
    # Cells farther from the walls are all there, as far as they hang together.
    core = free & (depths(free) > tolerance)
    rows, columns = np.mgrid[: free.shape[0], : free.shape[1]]
    start = np.argwhere(core & shapely.contains_xy(space, columns + 0.5, rows + 0.5))[0]
    assert space.buffer(1e-9).covers(squares(flood(core, (int(start[0]), int(start[1]))))), (seed, tolerance)


def test_straight_walls_stay_where_they_are(tmp_path: Path) -> None:
    free = np.zeros((40, 60), dtype=bool)
    free[3:37, 4:25] = free[15:22, 20:50] = free[5:35, 40:57] = True
    free[10:14, 10:16] = False
    assert load_cells(tmp_path, free, 3.0).polygon.equals(squares(free))


def test_a_staircase_becomes_a_straight_wall(tmp_path: Path) -> None:
    rows, columns = np.mgrid[:60, :60]
    free = (columns + 3 * rows > 50) & (rows < 55) & (columns < 57)
    environment = load_cells(tmp_path, free, 2.0)
    assert len(environment.vertices) <= 7


def test_walls_that_meet_in_a_corner_do_not_touch_themselves(tmp_path: Path) -> None:
    free = np.ones((20, 20), dtype=bool)
    for k in range(4, 15):
        free[k, k] = free[k, 19 - k] = False
    free[5:8, 12:14] = False
    free[8, 14] = False
    environment = load_cells(tmp_path, free)
    assert squares(free).covers(environment.polygon)


@pytest.mark.parametrize("tolerance", [1.0, 2.0])
@pytest.mark.parametrize("seed", range(4))
def test_the_kernel_cuts_the_corners_that_a_plain_program_cuts(seed: int, tolerance: float) -> None:
    free = largest(noise(seed, 14))
    depth = depths(free)
    free = largest(grid_outline.without_pinches(free, depth))
    rings = grid_outline.trace(free)
    core = free & (depth > tolerance)
    found = grid_outline.cut_corners(rings, core, tolerance)
    wanted = cut_corners(rings, squares(core), tolerance)
    assert [ring.tolist() for ring in found] == wanted, seed


def cut_corners(rings: list[NDArray[np.int64]], core: shapely.Geometry, tolerance: float) -> list[list[list[int]]]:
    """Smallest triangle first, cut every corner whose triangle is free of other corners and of the core."""
    left = [[(*point, number) for point in ring.tolist()] for number, ring in enumerate(rings)]
    numbers = {point: i for i, point in enumerate(point for ring in left for point in ring)}

    def triangles() -> list[tuple[Any, ...]]:
        found = []
        for ring in left:
            for i, v in enumerate(ring):
                a, b = ring[i - 1], ring[(i + 1) % len(ring)]
                doubled = (v[0] - a[0]) * (b[1] - a[1]) - (v[1] - a[1]) * (b[0] - a[0])
                found.append((doubled, numbers[v], numbers[a], numbers[b], a, v, b, ring))
        return sorted(found, key=lambda entry: entry[:4])

    refused: set[tuple[int, int, int]] = set()
    cut_since_start = False
    while True:
        for doubled, *key, a, v, b, ring in triangles():
            if tuple(key) in refused or doubled < 0 or len(ring) == 3:
                continue
            triangle = shapely.Polygon([a[:2], v[:2], b[:2]])
            others = [p[:2] for part in left for p in part if p not in (a, v, b)]
            shallow = doubled <= tolerance * math.dist(a[:2], b[:2])
            if shallow and not shapely.intersects_xy(triangle, np.array(others)).any() and blank(triangle, core):
                ring.remove(v)
                cut_since_start = True
                break
            refused.add(tuple(key))
        else:
            if not cut_since_start:
                return [[list(point[:2]) for point in ring] for ring in left]
            refused, cut_since_start = set(), False


def blank(triangle: shapely.Polygon, core: shapely.Geometry) -> bool:
    return bool(triangle.intersection(core).area < 1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_merged_corners_lose_no_core_and_one_reflex_corner_each(seed: int) -> None:
    free = enlarged(noise(seed, 14, share=0.7), 2)
    depth = depths(free)
    free = largest(grid_outline.without_pinches(free, depth))
    core = free & (depth > 2)
    rings = grid_outline.cut_corners(grid_outline.trace(free), core, 2)
    before = Environment(rings[0], rings[1:])
    merged = merge_corners(rings, core)
    after = Environment(merged[0], merged[1:])
    assert before.polygon.covers(after.polygon), seed
    assert after.polygon.covers(squares(core)), seed
    assert len(after.holes) == len(before.holes), seed
    gone = len(before.vertices) - len(after.vertices)
    assert gone > 0, seed
    assert len(after.reflex_vertices) <= len(before.reflex_vertices) - sum(map(len, rings)) + sum(map(len, merged))


def test_a_round_pillar_keeps_four_corners_and_a_passage_stays_open(tmp_path: Path) -> None:
    rows, columns = np.mgrid[:60, :60]
    free = np.hypot(rows - 30, columns - 30) > 5
    environment = load_cells(tmp_path, free, 3.0)
    assert len(environment.outer) == 4
    assert len(environment.holes[0]) <= 5
    free[:, 24:36] = False
    free[10:17, 24:36] = True  # seven cells: wider than twice 3, narrower than twice 4
    assert load_cells(tmp_path, free, 3.0).bounds == (0, 0, 60, 60)
    assert load_cells(tmp_path, free, 4.0).bounds[2] < 60


def test_the_tolerance_is_two_cells_unless_told_and_kept_with_the_map(tmp_path: Path) -> None:
    file = write_grid(tmp_path, np.full((12, 12), 254, dtype=np.uint8), resolution=0.05)
    assert load_occupancy_grid(file).source == "occupancy grid grid.yaml, outline within 0.1 m of its walls"
    assert "0.15 m" in load_occupancy_grid(file, tolerance_m=0.15).source
    with pytest.raises(BadGrid, match="nowhere wider than twice the tolerance"):
        load_occupancy_grid(file, tolerance_m=0.5)


# Specks


@pytest.mark.parametrize(("shape", "is_speck"), [((1, 1), True), ((2, 2), True), ((1, 4), True), ((1, 5), False)])
@pytest.mark.parametrize("shade", [0, 205])
def test_specks_become_free_up_to_the_stated_area(
    tmp_path: Path, shape: tuple[int, int], is_speck: bool, shade: int
) -> None:
    pixels = np.full((20, 20), 254, dtype=np.uint8)
    pixels[8 : 8 + shape[0], 7 : 7 + shape[1]] = shade
    environment = load_occupancy_grid(write_grid(tmp_path, pixels, resolution=0.05))
    assert (shape[0] * shape[1] * 0.05**2 <= SPECK_AREA_M2 + 1e-12) == is_speck
    assert (len(environment.holes) == 0) == is_speck


def test_what_hangs_together_by_corners_is_no_speck_and_coarse_grids_have_none(tmp_path: Path) -> None:
    pixels = np.full((18, 18), 254, dtype=np.uint8)
    for k in range(6, 12):
        pixels[k, k] = 0
    assert len(load_occupancy_grid(write_grid(tmp_path, pixels, resolution=0.05)).holes) == 1
    pixels[:] = 254
    pixels[8, 8] = 0
    assert len(load_occupancy_grid(write_grid(tmp_path, pixels, resolution=0.11)).holes) == 1
    pixels[:] = 254
    pixels[0, 5] = 0
    assert load_occupancy_grid(write_grid(tmp_path, pixels, resolution=0.05)).area < 18 * 18 * 0.05**2


def test_free_specks_are_left_out(tmp_path: Path) -> None:
    pixels = np.zeros((12, 20), dtype=np.uint8)
    pixels[2:10, 2:12] = 254
    pixels[5, 15] = pixels[1, 12] = 254
    assert load_occupancy_grid(write_grid(tmp_path, pixels)).area == 80


# What is refused


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("image", None, "'image'"),
        ("image", "absent.pgm", "absent.pgm' does not exist"),
        ("resolution", 0, "positive"),
        ("resolution", -0.05, "positive"),
        ("resolution", 1e-200, "0.0001 to 1000"),
        ("resolution", 10**400, "..."),
        ("origin", [0, 10**400, 0], "three numbers"),
        ("negate", 10**4200, "0 (white"),
        ("resolution", "fine", "'resolution' is 'fine'"),
        ("resolution", True, "'resolution' is True"),
        ("resolution", math.nan, "'resolution' is nan"),
        ("origin", [0, 0], "three numbers"),
        ("origin", [0, 0, "north"], "three numbers"),
        ("origin", 3, "three numbers"),
        ("negate", 2, "'negate' is 2"),
        ("negate", "maybe", "'negate'"),
        ("free_thresh", 0.7, "'free_thresh' 0.7 and 'occupied_thresh' 0.65"),
        ("free_thresh", -0.1, "between 0 and 1"),
        ("occupied_thresh", 65, "between 0 and 1"),
        ("mode", "binary", "one of trinary, scale, raw"),
        ("mode", ["scale"], "one of trinary, scale, raw"),
    ],
)
def test_a_bad_key_is_named_with_its_remedy(tmp_path: Path, key: str, value: Any, words: str) -> None:
    file = write_grid(tmp_path, np.full((4, 4), 254, dtype=np.uint8), **{key: value})
    refuses(file, words)


@pytest.mark.parametrize("key", ["image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh"])
def test_a_missing_key_is_named(tmp_path: Path, key: str) -> None:
    file = write_grid(tmp_path, np.full((4, 4), 254, dtype=np.uint8))
    keys = yaml.safe_load(file.read_text(encoding="utf-8"))
    del keys[key]
    file.write_text(yaml.safe_dump(keys), encoding="utf-8")
    refuses(file, f"key '{key}' is missing")


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"- 1\n- 2\n",
        b"resolution: [1",
        b"\xff\xfe\x00\x01",
        b"P5 4 4 255\n",
        b"image: 2020-13-45\n",
        b"image: " + b"[" * 3000,
        b"image: " + b"[" * 3000 + b"]" * 3000,
        b"resolution: 1" + b"0" * 5000,
        b"image: grid.png\nresolution: 0x" + b"f" * 5000,
    ],
    ids=range(10),
)
def test_a_file_that_is_no_grid_is_refused(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "grid.yaml"
    file.write_bytes(content)
    refuses(file, "grid")


def test_files_that_cannot_be_read_are_refused(tmp_path: Path) -> None:
    refuses(tmp_path / "absent.yaml", "cannot be read")
    file = write_grid(tmp_path, np.full((40, 40), 254, dtype=np.uint8))
    image = tmp_path / "grid.png"
    image.write_bytes(image.read_bytes()[:60])
    refuses(file, "cannot be read", named=image)
    image.write_text("not an image", encoding="utf-8")
    refuses(file, "cannot be read", named=image)


def test_a_grid_without_free_cells_and_too_fine_a_tolerance_are_refused(tmp_path: Path) -> None:
    refuses(write_grid(tmp_path, np.zeros((4, 4), dtype=np.uint8)), "no free cell")
    file = write_grid(tmp_path, np.full((4, 4), 254, dtype=np.uint8))
    for tolerance in (0.5, -1.0, math.nan, math.inf):
        with pytest.raises(BadGrid, match="finer than the grid"):
            load_occupancy_grid(file, tolerance_m=tolerance)


def refuses(file: Path, words: str, named: Path | None = None) -> None:
    with pytest.raises(BadGrid) as caught:
        load_occupancy_grid(file)
    sentence = str(caught.value)
    assert sentence.startswith(str(named or file)), sentence
    assert words in sentence, sentence
    assert "\n" not in sentence, sentence


# Grids of others


@pytest.mark.parametrize("name", ["turtlebot3_world", "nav2_tb3_sandbox", "nav2_depot", "nav2_warehouse"])
def test_grids_of_real_places_become_environments(name: str) -> None:
    root = Path(os.environ.get("SIGHTLINE_DATA", Path(__file__).parents[3] / "shared"))
    file = root / "maps" / "grids" / f"{name}.yaml"
    if not file.exists():
        pytest.skip(f"shared data not present: no {file} (set SIGHTLINE_DATA)")
    keys = yaml.safe_load(file.read_text(encoding="utf-8"))
    resolution, origin = keys["resolution"], np.array(keys["origin"][:2])
    with Image.open(file.parent / keys["image"]) as image:
        shades = np.asarray(image)[::-1]
    free = (255 - shades) / 255 < keys["free_thresh"]
    environment = Environment.load(file)
    space = environment.polygon
    shapely.prepare(space)

    def inside(lattice: NDArray[Any]) -> Booleans:
        x, y = (origin + lattice * resolution).T
        return np.asarray(shapely.contains_xy(space, x, y))

    # No corner and no centre of a cell that is not free lies inside, but for specks, and those are small.
    blocked = np.argwhere(~free)[:, ::-1]
    offending = {tuple(cell) for cell in blocked[inside(blocked + 0.5)]}
    for corner in ((0, 0), (0, 1), (1, 0), (1, 1)):
        offending |= {tuple(cell) for cell in blocked[inside(blocked + np.array(corner))]}
    assert all(len(speck) * resolution**2 <= SPECK_AREA_M2 + 1e-9 for speck in clusters(offending))

    # All is there but a fringe along the walls.
    counted = largest_by_runs(free) * resolution**2
    assert counted - 2 * resolution * space.length <= environment.area <= counted + 0.01 * counted
    assert len(environment.vertices) < 420
    assert len(environment.reflex_vertices) < 260


def clusters(cells: set[tuple[int, int]]) -> list[set[tuple[int, int]]]:
    """Cells that hang together by sides or corners."""
    found = []
    while cells:
        queue = [cells.pop()]
        cluster = set(queue)
        while queue:
            x, y = queue.pop()
            for other in [(x + i, y + j) for i in (-1, 0, 1) for j in (-1, 0, 1)]:
                if other in cells:
                    cells.remove(other)
                    cluster.add(other)
                    queue.append(other)
        found.append(cluster)
    return found


def largest_by_runs(free: Booleans) -> int:
    """Number of cells of the largest component, found by joining runs of rows."""
    parent: list[int] = []
    size: list[int] = []

    def root(i: int) -> int:
        while parent[i] != i:
            parent[i] = parent[parent[i]]
            i = parent[i]
        return i

    above: list[tuple[int, int, int]] = []
    for row in free:
        edges = np.flatnonzero(np.diff(np.concatenate([[0], row.astype(np.int8), [0]])))
        here = []
        for start, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
            run = len(parent)
            parent.append(run)
            size.append(end - start)
            for other_start, other_end, other in above:
                if other_start < end and start < other_end and root(other) != root(run):
                    size[root(run)] += size[root(other)]
                    parent[root(other)] = root(run)
            here.append((start, end, run))
        above = here
    return max(size)

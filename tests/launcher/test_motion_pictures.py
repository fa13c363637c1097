"""Pictures of schedules: what they show, held against plain samples of the motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapely
from PIL import Image

from launcher import motion_picture, picture
from launcher.coordination_picture import collision_outlines, draw_coordination, hidden_strips, progress_region
from launcher.motion_picture import draw_motion
from launcher.move_order import cover_path, leave_out_stops
from planning.environment import Environment
from planning.motion_plan import Schedule, TimedPath

ROOM = Environment([(0, 0), (12, 0), (12, 8), (0, 8)], [[(4, 2), (6, 2), (6, 6), (4, 6)]], "room")
ONE = TimedPath([(1, 1), (8, 1), (8, 1), (8, 7)], [0, 7, 11, 17])
OTHER = TimedPath([(11, 7), (8, 4), (8, 0.5)], [0, 4.25, 7.75])
TEAM = Schedule(
    ["base", "robot 1", "robot 2"], [TimedPath.standing((2, 7)), ONE, OTHER], [0, 0.3, 0.3], 1.0,
    [[0, 0, 0, 0, 0], [0, 1, 1, 2, 3], [0, 0, 1, 2, 2]],
)  # fmt: skip
MARKERS = {"base": "B", "robot 1": "1", "robot 2": "2"}


def samples(path: TimedPath, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Metres of path, and the places there."""
    points = leave_out_stops(path.waypoints)
    covered = cover_path(points)
    metres = np.linspace(0, covered[-1], number)
    return metres, np.stack([np.interp(metres, covered, points[:, axis]) for axis in (0, 1)], axis=1)


def hexadecimal(colour: str) -> tuple[int, ...]:
    return tuple(bytes.fromhex(colour[1:]))


def test_regions_of_collision_hold_what_collides() -> None:
    (x, p), (y, q) = samples(ONE, 150), samples(OTHER, 90)
    near = np.hypot(*(p[:, None] - q).transpose(2, 0, 1)) < 0.6
    assert 0 < near.sum() < near.size / 4
    paths = (leave_out_stops(path.waypoints) for path in (ONE, OTHER))
    region = shapely.unary_union([shapely.Polygon(ring) for ring in collision_outlines(*paths, 0.6)])
    points = shapely.points(*np.meshgrid(x, y, indexing="ij"))
    assert shapely.covers(region.buffer(0.02), points[near]).all()
    assert not shapely.covers(region.buffer(-0.02), points[~near]).any()


def test_strips_without_sight_are_where_there_is_none() -> None:
    (x, p), (y, q) = samples(ONE, 60), samples(OTHER, 40)
    strips = hidden_strips(ROOM, *(leave_out_stops(path.waypoints) for path in (ONE, OTHER)))
    hidden = shapely.unary_union([shapely.Polygon(strip) for strip in strips])
    seen = np.array([[ROOM.line_of_sight(tuple(a), tuple(b)) for b in q] for a in p])
    assert 0 < (~seen).sum() < seen.size
    points = shapely.points(*np.meshgrid(x, y, indexing="ij"))
    assert shapely.covers(hidden.buffer(0.05), points[~seen]).all()
    assert not shapely.covers(hidden.buffer(-0.05), points[seen]).any()


@pytest.mark.parametrize("free", [(), ("robot 1",)])
def test_the_region_of_progress_is_all_boxes_of_two_stages(free: tuple[str, ...]) -> None:
    team = Schedule(TEAM.members, TEAM.paths, TEAM.radii_m, 1.0, TEAM.stages, free)
    assert TEAM.stages is not None
    borders = [cover_path(team.paths[row].waypoints)[TEAM.stages[row]] for row in (1, 2)]
    boxes = [
        shapely.box(borders[0][n], borders[1][n], borders[0][n + 2], borders[1][n + 2])
        for n in range(team.stage_count - 1)
    ]
    if free:
        boxes = [shapely.box(0, 0, borders[0][-1], borders[1][-1])]
    region = shapely.Polygon(progress_region(team, (1, 2)))
    assert region.buffer(0).symmetric_difference(shapely.unary_union(boxes)).area < 1e-9


def test_a_motion_shows_paths_links_and_the_order_below(tmp_path: Path) -> None:
    before, after = [((2.0, 7.0), (1.0, 1.0))], [((2.0, 7.0), (8.0, 7.0))]
    draw_motion(ROOM, None, TEAM, MARKERS, after, tmp_path / "motion.png", "2 robots", links_before=before)
    with Image.open(tmp_path / "motion.png") as image:
        pixels = np.asarray(image.convert("RGB"))
    wall = np.argwhere((pixels == hexadecimal(picture.WALL)).all(axis=2))
    left = wall[:, 1].min()
    bottom = wall[wall[:, 1] < left + 3, 0].max()
    dots_per_m = (wall[:, 1].max() - left) / 12
    for colour, path in zip(motion_picture.PATHS, (ONE, OTHER), strict=False):
        drawn = (pixels == hexadecimal(colour)).all(axis=2)
        _, places = samples(path, 40)
        at = np.column_stack([bottom - places[:, 1] * dots_per_m, left + places[:, 0] * dots_per_m]).round().astype(int)
        assert np.mean([drawn[y - 1 : y + 2, x - 1 : x + 2].any() for y, x in at]) > 0.6
        assert drawn[bottom + 20 :].sum() > 500, "the order of moves"
    assert (pixels == hexadecimal(picture.SIGHT)).all(axis=2).sum() > 500


def test_a_motion_of_nobody_and_other_formats(tmp_path: Path) -> None:
    still = Schedule(["base"], [TimedPath.standing((2, 7))], 0.2, 1.0, [[0, 0]])
    draw_motion(ROOM, None, still, {"base": "B"}, [], tmp_path / "still.svg", "nobody")
    assert "<!-- base -->" in (tmp_path / "still.svg").read_text(encoding="utf-8")


def test_a_diagram_is_written_with_what_it_explains(tmp_path: Path) -> None:
    draw_coordination(ROOM, TEAM, (1, 2), ("robot 1", "robot 2"), tmp_path / "pair.svg", "1 and 2")
    text = (tmp_path / "pair.svg").read_text(encoding="utf-8")
    for words in (
        "discs overlap",
        "boxes around that",
        "no line of sight",
        "whoever is late",
        "robot 2: metres of its 7.7",
    ):
        assert f"<!-- {words}" in text or words in text, words
    open_room = Environment(ROOM.outer, [], "hall")
    far = Schedule(["a", "b"], [TimedPath([(1, 1), (2, 1)], [0, 1]), TimedPath([(9, 1), (9, 7)], [0, 6])], 0.2)
    draw_coordination(open_room, far, (0, 1), ("a", "b"), tmp_path / "far.svg", "far")
    text = (tmp_path / "far.svg").read_text(encoding="utf-8")
    for words in ("discs overlap", "no line of sight", "whoever is late"):
        assert words not in text
    with pytest.raises(picture.BadPicture, match="give a name that ends so"):
        draw_coordination(open_room, far, (0, 1), ("a", "b"), tmp_path / "far.bmp", "far")

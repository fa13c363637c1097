from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from launcher.picture import BadPicture, draw_map, draw_plan
from planning.environment import Environment

ROOM = Environment([(0, 0), (12, 0), (12, 8), (0, 8)], [[(4, 2), (6, 2), (6, 6), (4, 6)]], "room")
CELLS = [np.array([(0.0, 0), (4, 0), (4, 8), (0, 8)]), np.array([(6.0, 0), (12, 0), (12, 8), (6, 8)])]


def colours(file: Path) -> set[tuple[int, ...]]:
    """Colours that cover more than a few pixels."""
    with Image.open(file) as image:
        counted = image.convert("RGB").getcolors(1 << 20)
    assert counted is not None
    return {colour for count, colour in counted if count > 20}


def hexadecimal(colour: str) -> tuple[int, ...]:
    return tuple(bytes.fromhex(colour[1:]))


def test_a_map_shows_floor_and_solid_in_the_right_places_to_scale(tmp_path: Path) -> None:
    from launcher import picture

    draw_map(ROOM, None, tmp_path / "map.png", "room")
    with Image.open(tmp_path / "map.png") as image:
        pixels = np.asarray(image.convert("RGB"))
    wall = np.argwhere((pixels == hexadecimal(picture.WALL)).all(axis=2))
    (top, left), (bottom, right) = wall.min(axis=0), wall.max(axis=0)
    dots_per_m = (right - left) / 12
    assert (bottom - top) / 8 == pytest.approx(dots_per_m, rel=0.01)

    def colour_at(x: float, y: float) -> tuple[int, ...]:
        return tuple(pixels[round(bottom - y * dots_per_m), round(left + x * dots_per_m)].tolist())

    for x, y in ((1, 1), (11, 7), (5, 1), (5, 7)):
        assert colour_at(x, y) == hexadecimal(picture._FLOOR)
    for x, y in ((5, 4), (4.5, 5.5), (-0.1, 4), (12.1, 1)):
        assert colour_at(x, y) == hexadecimal(picture._SOLID)


def test_cells_are_drawn_when_given(tmp_path: Path) -> None:
    draw_map(ROOM, None, tmp_path / "bare.png", "room")
    draw_map(ROOM, CELLS, tmp_path / "cells.png", "room")
    assert len(colours(tmp_path / "cells.png") - colours(tmp_path / "bare.png")) > 0


def test_a_plan_shows_base_relays_agents_and_links(tmp_path: Path) -> None:
    from launcher import picture

    relays = [(1.0, 7.0), (9.0, 7.0)]
    links = [((1.0, 1.0), relays[0]), (relays[0], relays[1]), (relays[1], (11.0, 1.0))]
    draw_plan(ROOM, CELLS, (1.0, 1.0), [(11.0, 1.0)], relays, links, tmp_path / "plan.png", "2 relays")
    wanted = {hexadecimal(c) for c in (picture.BASE, picture.RELAY, picture.AGENT, picture.SIGHT)}
    assert wanted <= colours(tmp_path / "plan.png")


def test_a_plan_without_relays_and_other_formats(tmp_path: Path) -> None:
    for suffix in (".pdf", ".svg", ".PNG"):
        file = tmp_path / f"plan{suffix}"
        draw_plan(ROOM, None, (1.0, 1.0), [(2.0, 1.0)], [], [((1.0, 1.0), (2.0, 1.0))], file, "no relays")
        assert file.stat().st_size > 1000


def test_titles_are_text_and_no_formulas(tmp_path: Path) -> None:
    draw_map(ROOM, None, tmp_path / "map.png", "a map called $\\room_1 $ or $")


@pytest.mark.parametrize(
    ("name", "words"),
    [("map.bmp", "give a name that ends so"), ("map", "give a name"), ("absent/map.png", "cannot be written")],
)
def test_pictures_that_cannot_be_written_are_refused(tmp_path: Path, name: str, words: str) -> None:
    with pytest.raises(BadPicture, match=words) as caught:
        draw_map(ROOM, None, tmp_path / name, "room")
    assert str(caught.value).startswith(str(tmp_path / name))


def test_matplotlib_is_not_imported_before_a_picture_is_drawn() -> None:
    program = "import sys, launcher.picture; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0


def test_no_marker_covers_another() -> None:
    from matplotlib.figure import Figure

    from launcher import picture

    axes = Figure(figsize=(9, 6)).add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, 12), ylim=(0, 8))
    places = np.array([(2.0, 2.0)] * 5 + [(2.05, 2.0), (9.0, 5.0), (9.01, 5.0), (6.0, 4.0)])
    shown = picture.spread_markers(axes, places)
    points = axes.transData.transform(shown) * 72 / axes.figure.dpi
    apart = np.linalg.norm(points[:, None] - points, axis=2)[np.triu_indices(len(points), 1)]
    assert apart.min() > 0.98 * picture._APART_PT
    assert np.array_equal(shown[-1], places[-1])
    assert np.abs(shown - places).max() < 0.5

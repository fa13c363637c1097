"""A tight set as numbers: whoever goes on from them goes on exactly."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from estimation.range_measurement import NothingMeasured
from estimation.tight_set import TightSet
from estimation.tight_snapshot import TightPiece, TightSnapshot


def run(seed: int, ranges: int) -> list[tuple[tuple[float, float], float]]:
    rng = np.random.default_rng(seed)
    target = rng.uniform(-5, 5, 2)
    made = []
    for _ in range(ranges):
        anchor = rng.uniform(-8, 8, 2)
        z = float(np.hypot(*(target - anchor)) + rng.uniform(-0.3, 0.3))
        made.append(((float(anchor[0]), float(anchor[1])), max(z + 9.0 * (rng.random() < 0.1), 0.0)))
    return made


def feed(held: TightSet, made: list[tuple[tuple[float, float], float]]) -> TightSet:
    for anchor, z in made:
        held.predict(0.1)
        held.measure(anchor, z, 0.3)
    return held


@pytest.mark.parametrize("seed", range(8))
def test_going_on_from_a_snapshot_is_going_on(seed: int) -> None:
    made = run(seed, 24)
    here = feed(TightSet(), made[: 1 + seed])
    there = TightSet()
    sent = msgspec.json.decode(msgspec.json.encode(here.snapshot()), type=TightSnapshot)
    there.restore(sent)
    assert there.area_m2 == here.area_m2
    for anchor, z in made[1 + seed :]:
        feed(here, [(anchor, z)])
        feed(there, [(anchor, z)])
        assert there.snapshot() == here.snapshot()


def test_only_the_pieces_kept_are_left() -> None:
    held = feed(TightSet(), run(3, 2))
    pieces = held.polygons
    which = np.arange(len(pieces)) % 2 == 0
    held.keep(which)
    assert [piece.tolist() for piece in held.polygons] == [piece.tolist() for piece in pieces[::2]]
    assert not held.contains(pieces[1].mean(axis=0))
    with pytest.raises(ValueError, match="keep at least one"):
        held.keep(np.zeros(len(held.polygons), dtype=bool))


def test_what_is_no_set_is_refused() -> None:
    held = feed(TightSet(), run(4, 5))
    snapshot, before = held.snapshot(), held.area_m2
    square = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
    crossing = (square[0], square[2], square[1], square[3])
    for corners in (square[::-1], crossing, square[:2], square * 5):
        with pytest.raises(ValueError, match="leave this"):
            held.restore(replace(snapshot, pieces=(TightPiece(corners, 1.0),)))
    with pytest.raises(ValueError, match="leave this"):
        held.restore(replace(snapshot, pieces=()))
    assert held.area_m2 == before
    with pytest.raises(NothingMeasured):
        TightSet().snapshot()
    with pytest.raises(ValueError, match="reject"):
        TightSet("relaxed").restore(snapshot)

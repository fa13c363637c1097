"""Compiling the numerical kernels once, in one process, before a team of processes needs them all at the same time.

numba keeps compiled kernels beside the source (or, where that is read-only, in the user's cache folder). A stamp
named after the sources, the versions and the processor says that this has been done.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import numpy as np


def warm_up(announce: Callable[[str], None] = lambda _: None) -> bool:
    """Compile every kernel of the package unless that has been done; say so through ``announce`` beforehand.

    Returns:
        Whether anything had to be compiled.
    """
    stamp = _stamp()
    if stamp.exists():
        return False
    announce("Compiling the numerical kernels (once for this version; about a minute) ...")
    exercise()
    stamp.parent.mkdir(parents=True, exist_ok=True)
    stamp.touch()
    return True


def exercise() -> None:
    """Run every kernel on a room with a pillar, with the argument types of real use."""
    from planning.connectivity import connected
    from planning.decomposition import decompose
    from planning.edge_weights import virtual_weights
    from planning.environment import Environment
    from planning.geodesic import GeodesicMap
    from planning.mutual_visibility import mutual_visibility
    from planning.placement import reachable_positions
    from planning.shortest_paths import all_pairs, from_source

    room = Environment(
        [(0, 0), (8, 0), (8, 3), (10, 3), (10, 0), (18, 0), (18, 8), (10, 8), (10, 5), (8, 5), (8, 8), (0, 8)],
        [[(3, 3), (4, 3), (4, 4), (3, 4)]],
        name="warm-up",
    )
    free = room.inflated(0.2)
    points = np.array([[1.0, 1.0], [17.0, 1.0], [9.0, 4.0], [17.0, 7.0]])
    connected(room.visibility_matrix(points))
    room.line_of_sight(points[0], points[1])
    room.contains(points)
    geodesics = GeodesicMap(free)
    geodesics.path(points[0], points[1])
    geodesics.lengths(points[0], points[1:])
    for kind in ("inflection", "aspect"):
        cells = decompose(room, kind)
        cells.locate(points)
        weights = virtual_weights(cells, mutual_visibility(cells))
        all_pairs(weights)
        from_source(weights, 0)
        reachable_positions(cells, free)


def _stamp() -> Path:
    import llvmlite.binding

    here = Path(__file__).parent
    digest = hashlib.sha256()
    for file in sorted(here.glob("*.py")):
        digest.update(file.read_bytes())
    for word in (sys.version, version("numba"), llvmlite.binding.get_host_cpu_name()):
        digest.update(word.encode())
    folder = here / "__pycache__"
    return folder / f"kernels-{digest.hexdigest()[:16]}.ready"

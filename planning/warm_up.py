"""Compiling the numerical kernels once, in one process, before a team of processes needs them all at the same time.

numba keeps compiled kernels beside the source or, where that is read-only, in the user's cache folder. It takes a kept
kernel to be fresh while the kernel's *own* file is unchanged, although a kernel contains the code of those that it
calls. So a stamp named after all sources, the versions and the processor says that everything was compiled together;
where the stamp is missing, what was kept is thrown away first.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import numpy as np


def warm_up(announce: Callable[[str], None] = lambda _: None) -> bool:
    """Compile every kernel of the package unless that has been done; say so through ``announce`` beforehand.

    To be called before the first kernel of the process: what it has loaded it keeps.

    Returns:
        Whether anything had to be compiled.
    """
    folder = _cache_folder()
    stamp = folder / f"kernels-{_fingerprint()}.ready"
    if stamp.exists():
        return False
    announce("Compiling the numerical kernels (once for this version; about a minute) ...")
    for stale in (*folder.glob("*.nbi"), *folder.glob("*.nbc"), *folder.glob("kernels-*.ready")):
        stale.unlink(missing_ok=True)
    exercise()
    folder.mkdir(parents=True, exist_ok=True)
    stamp.touch()
    return True


def exercise() -> None:
    """Run every kernel on two rooms with a pillar, with the argument types of real use."""
    from planning.connectivity import connected
    from planning.decomposition import decompose
    from planning.edge_weights import virtual_weights
    from planning.environment import Environment
    from planning.geodesic import GeodesicMap
    from planning.grid_outline import outline
    from planning.mutual_visibility import mutual_visibility
    from planning.placement import reachable_positions
    from planning.shortest_paths import all_pairs, from_source

    outline(np.ones((4, 4), dtype=np.bool_), np.ones((4, 4)), 1.0)
    rooms = Environment(
        [(0, 0), (8, 0), (8, 3), (10, 3), (10, 0), (18, 0), (18, 8), (10, 8), (10, 5), (8, 5), (8, 8), (0, 8)],
        [[(3, 3), (4, 3), (4, 4), (3, 4)]],
        name="warm-up",
    )
    free = rooms.inflated(0.2)
    points = np.array([[1.0, 1.0], [17.0, 1.0], [9.0, 4.0], [17.0, 7.0]])
    connected(rooms.visibility_matrix(points))
    rooms.line_of_sight(points[0], points[1])
    rooms.contains(points)
    geodesics = GeodesicMap(free)
    geodesics.path(points[0], points[1])
    geodesics.lengths(points[0], points[1:])
    geodesics.nearest((-1.0, -1.0))
    for kind in ("inflection", "aspect"):
        cells = decompose(rooms, kind)
        cells.locate(points)
        weights = virtual_weights(cells, mutual_visibility(cells))
        all_pairs(weights)
        from_source(weights, 0)
        reachable_positions(cells, free)


def _cache_folder() -> Path:
    """Where this package's compiled kernels are, and its stamp."""
    beside = Path(__file__).parent / "__pycache__"
    if os.access(beside if beside.exists() else beside.parent, os.W_OK):
        return beside
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "sightline"


def _fingerprint() -> str:
    """Digest of the sources and of what else the machine code depends on."""
    import llvmlite.binding

    digest = hashlib.sha256()
    for file in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(file.read_bytes())
    for word in (sys.version, version("numba"), llvmlite.binding.get_host_cpu_name()):
        digest.update(word.encode())
    return digest.hexdigest()[:16]

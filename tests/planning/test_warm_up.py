"""After warming up, nothing is compiled any more: seen from a process that does what peers and commands do."""

from __future__ import annotations

import subprocess
import sys

REAL_USE = """
import numpy as np
import maps
from numba.core.dispatcher import Dispatcher
from planning.environment import Environment
from planning.geodesic import GeodesicMap
from planning.connectivity import component_labels
from planning.decomposition import decompose
from planning.edge_weights import virtual_weights
from planning.mutual_visibility import mutual_visibility
from planning.placement import reachable_positions
from planning.shortest_paths import all_pairs, from_source
from agents.leader import DeploymentPlanner

for name, kind in (("room1", "aspect"), ("room2", "aspect"), ("office", "inflection")):
    environment = Environment.load(maps.path(name))
    free = environment.inflated(0.2)
    cells = decompose(environment, kind)
    places = reachable_positions(cells, free)
    places = places[~np.isnan(places[:, 0])]
    component_labels(environment.visibility_matrix(places[:5]))
    geodesics = GeodesicMap(free)
    geodesics.path(places[0], places[1]); geodesics.lengths(places[0], places)
    weights = virtual_weights(cells, mutual_visibility(cells))
    all_pairs(weights); from_source(weights, 0)
    base, agent = (tuple(map(float, places[i])) for i in (0, 1))
    planner = DeploymentPlanner(environment, base, 0.2, kind)
    robots = {f"robot_{i}": tuple(map(float, places[2 + i])) for i in range(4)}
    plan = planner.plan(agent, (agent,), robots, None)
    planner.plan(agent, (agent,), robots, plan)

import gc
compiled = {f"{d.py_func.__module__}.{d.py_func.__name__}": dict(d.stats.cache_misses)
            for d in gc.get_objects() if isinstance(d, Dispatcher) and d.py_func.__module__.startswith("planning.")}
assert compiled, "no kernel was found"
missed = {name: misses for name, misses in compiled.items() if misses}
assert not missed, missed
"""


def test_real_use_compiles_nothing_after_the_warm_up() -> None:
    done = subprocess.run([sys.executable, "-c", REAL_USE], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr

"""After warming up, nothing is compiled any more: seen from a process that does what peers and commands do."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import launcher.kernels

COUNT = """
import gc
from numba.core.dispatcher import Dispatcher

def compiled(package):
    return {(d.py_func.__module__, d.py_func.__name__, str(s)) for d in gc.get_objects()
            if isinstance(d, Dispatcher) and d.py_func.__module__.startswith(package) for s in d.overloads}
"""

PLANNING = """
import numpy as np
import maps
from planning.environment import Environment
from planning.geodesic import GeodesicMap
from planning.connectivity import component_labels
from planning.decomposition import decompose
from planning.edge_weights import virtual_weights
from planning.mutual_visibility import mutual_visibility
from planning.placement import reachable_positions
from planning.redeployment import redeploy
from planning.shortest_paths import all_pairs, from_source
from planning.steiner import steiner_tree
from agents.leader import DeploymentPlanner
from agents.whereabouts import announce

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
    base, agent = (tuple(map(float, places[i])) for i in (0, -1))
    robots = {f"robot_{i}": tuple(map(float, places[2 + i])) for i in range(5)}
    for placements in ("cells", "points"):
        for search in ("chain", "exact", "one-edge", "fixed"):
            planner = DeploymentPlanner(environment, base, 0.2, kind, placements=placements, search=search)
            plan = planner.plan(announce([agent, agent]), robots, None)
            planner.plan(announce([agent, agent]), robots, plan)
            planner.most_relays_needed()
for method in ("exact", "mst", "takahashi-matsuyama"):
    steiner_tree(weights, [0, 1, 2], method)
steiner_tree(weights, [0, 1, 2], vertices=8)
for number in (3, 9, 16):
    move = np.random.default_rng(0).uniform(0.0, 5.0, (number, len(weights)))
    tree = [(node, node + 1) for node in range(number - 1)]
    for search in ("exact", "one-edge", "fixed", "chain"):
        for idle in (False, True):
            redeploy(move, weights, 1.0, search, tree, idle=idle)
"""


ESTIMATION = """
from launcher.studies.ranging_run import EXPERIMENTS, LAWS, run_experiment

for law in LAWS:
    run_experiment(EXPERIMENTS[-1], law, 1)
"""


@pytest.mark.parametrize(("package", "use"), [("planning", PLANNING), ("estimation", ESTIMATION)])
def test_real_use_compiles_nothing_after_the_warm_up(package: str, use: str) -> None:
    code = f"""{COUNT}
from {package}.warm_up import exercise
exercise()
warm = compiled("{package}.")
assert warm, "no kernel was found"
{use}
cold = compiled("{package}.") - warm
assert not cold, cold
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_kernels_are_compiled_again_when_a_source_that_they_depend_on_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "sampled"
    kept = package / "__pycache__"
    kept.mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "kernel.py").write_text("kernel = None\n")
    (package / "plain.py").write_text("x = 1\n")
    (package / "inner.py").write_text("from sampled.kernel import kernel\n")
    (package / "outer.py").write_text("from sampled.kernel import kernel\nfrom sampled.inner import kernel as k\n")
    (package / "warm_up.py").write_text(
        "def part():\n    with open(__file__ + '.log', 'a') as log:\n        log.write('.')\n\nPARTS = (part,)\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(launcher.kernels, "PACKAGES", ("sampled",))
    monkeypatch.setattr(launcher.kernels, "__file__", str(tmp_path / "launcher" / "kernels.py"))
    said: list[str] = []

    def compiled_again() -> set[str]:
        """Modules whose kept kernels are gone after the next warm-up."""
        for module in ("inner", "outer"):
            (kept / f"{module}.f-1.py311.nbi").touch()
        launcher.kernels.warm_up(said.append)
        return {module for module in ("inner", "outer") if not (kept / f"{module}.f-1.py311.nbi").exists()}

    assert compiled_again() == {"inner", "outer"}
    assert compiled_again() == set()
    (package / "plain.py").write_text("x = 2\n")
    assert compiled_again() == set()
    (package / "outer.py").write_text("from sampled.kernel import kernel\nfrom sampled.inner import kernel as g\n")
    assert compiled_again() == {"outer"}
    (package / "inner.py").write_text("from sampled.kernel import kernel  # changed\n")
    assert compiled_again() == {"inner", "outer"}
    (kept / "kernels.json").write_text("cut sh")
    assert compiled_again() == {"inner", "outer"}
    assert len(said) == 4
    assert (package / "warm_up.py.log").read_text() == "...."


def test_kernels_that_do_not_compile_are_not_taken_for_compiled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "broken"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "warm_up.py").write_text(
        "def works(): pass\n\ndef fails(): raise TypeError('no such type')\n\nPARTS = (works, fails)\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(launcher.kernels, "__file__", str(tmp_path / "launcher" / "kernels.py"))
    for _ in range(2):
        with pytest.raises(launcher.kernels.CompilationFailed, match=r"kernels of broken .*(?s:.)*no such type"):
            launcher.kernels.warm_up(packages=["broken"])

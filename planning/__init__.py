"""Planning: maps, convex cells, mutual visibility, deployments and paths, as functions of arrays.

The public names are loaded when they are first used, so that a process that only asks for geodesics does not pay for
the import of the decompositions.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from planning.adjacency_path import AdjacencyPaths
    from planning.certificate import Certificate, certify
    from planning.chain import Chain, chain_between, cheapest_chain
    from planning.compiled_map import CompiledMap
    from planning.coordination_diagram import CoordinationDiagram
    from planning.decomposition import Cells, decompose
    from planning.deployment import Deployment, identify_robots, shortest_path_deployment
    from planning.deployment_sequence import DeploymentSequence, identify_deployment, identify_sequence, physical_cost
    from planning.edge_weights import virtual_weights
    from planning.environment import Environment
    from planning.forecast import forecast_cells
    from planning.geodesic import GeodesicMap
    from planning.hybrid_schedule import adjacency_schedule, hybrid_schedule
    from planning.motion import Motion, plan_motion
    from planning.motion_plan import InvalidSchedule, Schedule, TimedPath
    from planning.mutual_visibility import mutual_visibility
    from planning.no_schedule import NoSchedule
    from planning.physical_weights import (
        adjacency_path_weights,
        arrival_times,
        bounded_weights,
        euclidean_weights,
        geodesic_weights,
    )
    from planning.placement_graph import PlacementGraph
    from planning.reach_in_sight import time_in_sight
    from planning.redeployment import Redeployment, redeploy
    from planning.relays import MostRelays, RelayTree, fewest_relays, most_relays
    from planning.schedule import schedule
    from planning.shortest_paths import all_pairs, from_source
    from planning.steiner import steiner_tree
    from planning.tree import Tree

__all__ = [
    "AdjacencyPaths",
    "Cells",
    "Certificate",
    "Chain",
    "CompiledMap",
    "CoordinationDiagram",
    "Deployment",
    "DeploymentSequence",
    "Environment",
    "GeodesicMap",
    "InvalidSchedule",
    "MostRelays",
    "Motion",
    "NoSchedule",
    "PlacementGraph",
    "Redeployment",
    "RelayTree",
    "Schedule",
    "TimedPath",
    "Tree",
    "adjacency_path_weights",
    "adjacency_schedule",
    "all_pairs",
    "arrival_times",
    "bounded_weights",
    "certify",
    "chain_between",
    "cheapest_chain",
    "decompose",
    "euclidean_weights",
    "fewest_relays",
    "forecast_cells",
    "from_source",
    "geodesic_weights",
    "hybrid_schedule",
    "identify_deployment",
    "identify_robots",
    "identify_sequence",
    "most_relays",
    "mutual_visibility",
    "physical_cost",
    "plan_motion",
    "redeploy",
    "schedule",
    "shortest_path_deployment",
    "steiner_tree",
    "time_in_sight",
    "virtual_weights",
]

_HOMES = {
    "AdjacencyPaths": "planning.adjacency_path",
    "Cells": "planning.decomposition",
    "Certificate": "planning.certificate",
    "Chain": "planning.chain",
    "CompiledMap": "planning.compiled_map",
    "CoordinationDiagram": "planning.coordination_diagram",
    "Deployment": "planning.deployment",
    "DeploymentSequence": "planning.deployment_sequence",
    "Environment": "planning.environment",
    "GeodesicMap": "planning.geodesic",
    "InvalidSchedule": "planning.motion_plan",
    "MostRelays": "planning.relays",
    "Motion": "planning.motion",
    "NoSchedule": "planning.no_schedule",
    "PlacementGraph": "planning.placement_graph",
    "Redeployment": "planning.redeployment",
    "RelayTree": "planning.relays",
    "Schedule": "planning.motion_plan",
    "TimedPath": "planning.motion_plan",
    "Tree": "planning.tree",
    "adjacency_path_weights": "planning.physical_weights",
    "adjacency_schedule": "planning.hybrid_schedule",
    "all_pairs": "planning.shortest_paths",
    "arrival_times": "planning.physical_weights",
    "bounded_weights": "planning.physical_weights",
    "certify": "planning.certificate",
    "chain_between": "planning.chain",
    "cheapest_chain": "planning.chain",
    "decompose": "planning.decomposition",
    "euclidean_weights": "planning.physical_weights",
    "fewest_relays": "planning.relays",
    "forecast_cells": "planning.forecast",
    "from_source": "planning.shortest_paths",
    "geodesic_weights": "planning.physical_weights",
    "hybrid_schedule": "planning.hybrid_schedule",
    "identify_deployment": "planning.deployment_sequence",
    "identify_robots": "planning.deployment",
    "identify_sequence": "planning.deployment_sequence",
    "most_relays": "planning.relays",
    "mutual_visibility": "planning.mutual_visibility",
    "physical_cost": "planning.deployment_sequence",
    "plan_motion": "planning.motion",
    "redeploy": "planning.redeployment",
    "schedule": "planning.schedule",
    "shortest_path_deployment": "planning.deployment",
    "steiner_tree": "planning.steiner",
    "time_in_sight": "planning.reach_in_sight",
    "virtual_weights": "planning.edge_weights",
}


def __getattr__(name: str) -> Any:
    """Load a public name from its module (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module 'planning' has no attribute {name!r}")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


class _Package(ModuleType):
    """Keeps a public function visible although a submodule of the same name, once imported, would take its place."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in _HOMES and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package


def __dir__() -> list[str]:
    """Public names, loaded or not."""
    return sorted({*globals(), *__all__})

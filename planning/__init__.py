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
    from planning.compiled_map import CompiledMap
    from planning.decomposition import Cells, decompose
    from planning.deployment import Deployment
    from planning.deployment_sequence import DeploymentSequence, identify_sequence, physical_cost
    from planning.edge_weights import virtual_weights
    from planning.environment import Environment
    from planning.geodesic import GeodesicMap
    from planning.motion_plan import Schedule, TimedPath
    from planning.mutual_visibility import mutual_visibility
    from planning.physical_weights import (
        adjacency_path_weights,
        arrival_times,
        bounded_weights,
        euclidean_weights,
        geodesic_weights,
    )
    from planning.placement_graph import PlacementGraph
    from planning.redeployment import Redeployment, redeploy
    from planning.steiner import steiner_tree
    from planning.tree import Tree

__all__ = [
    "AdjacencyPaths",
    "Cells",
    "Certificate",
    "CompiledMap",
    "Deployment",
    "DeploymentSequence",
    "Environment",
    "GeodesicMap",
    "PlacementGraph",
    "Redeployment",
    "Schedule",
    "TimedPath",
    "Tree",
    "adjacency_path_weights",
    "arrival_times",
    "bounded_weights",
    "certify",
    "decompose",
    "euclidean_weights",
    "geodesic_weights",
    "identify_sequence",
    "mutual_visibility",
    "physical_cost",
    "redeploy",
    "steiner_tree",
    "virtual_weights",
]

_HOMES = {
    "AdjacencyPaths": "planning.adjacency_path",
    "Cells": "planning.decomposition",
    "Certificate": "planning.certificate",
    "CompiledMap": "planning.compiled_map",
    "Deployment": "planning.deployment",
    "DeploymentSequence": "planning.deployment_sequence",
    "Environment": "planning.environment",
    "GeodesicMap": "planning.geodesic",
    "PlacementGraph": "planning.placement_graph",
    "Redeployment": "planning.redeployment",
    "Schedule": "planning.motion_plan",
    "TimedPath": "planning.motion_plan",
    "Tree": "planning.tree",
    "adjacency_path_weights": "planning.physical_weights",
    "arrival_times": "planning.physical_weights",
    "bounded_weights": "planning.physical_weights",
    "certify": "planning.certificate",
    "decompose": "planning.decomposition",
    "euclidean_weights": "planning.physical_weights",
    "geodesic_weights": "planning.physical_weights",
    "identify_sequence": "planning.deployment_sequence",
    "mutual_visibility": "planning.mutual_visibility",
    "physical_cost": "planning.deployment_sequence",
    "redeploy": "planning.redeployment",
    "steiner_tree": "planning.steiner",
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

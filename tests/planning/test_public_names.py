"""The public names are what `from planning import ...` gives, in whatever order modules were imported before."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module

import pytest

import planning


@pytest.mark.parametrize("name", planning.__all__)
def test_public_name_is_the_object_of_its_module(name: str) -> None:
    value = getattr(planning, name)
    assert callable(value)
    assert value is getattr(import_module(value.__module__), name)


def test_shortest_paths_relays_and_chains_are_public() -> None:
    assert {"all_pairs", "shortest_path_deployment", "most_relays", "fewest_relays", "cheapest_chain"} <= {
        *planning.__all__
    }


def test_a_function_is_not_hidden_by_the_submodule_of_the_same_name() -> None:
    code = "import planning.mutual_visibility; from planning import mutual_visibility; mutual_visibility.__call__"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no_such_name"):
        planning.no_such_name  # noqa: B018

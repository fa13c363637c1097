"""docs/scenario.md names every key of a scenario, and its example is one that can be run."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import msgspec

from launcher.preparation import prepare
from launcher.scenario import Scenario

PAGE = (Path(__file__).parents[2] / "docs" / "scenario.md").read_text(encoding="utf-8")


def keys_of(table: type[msgspec.Struct]) -> Iterator[str]:
    for field in msgspec.structs.fields(table):
        yield field.name
        if isinstance(field.type, type) and issubclass(field.type, msgspec.Struct):
            yield from keys_of(field.type)


def test_the_reference_names_every_key() -> None:
    missing = [key for key in keys_of(Scenario) if not re.search(rf"\b{key}\b", PAGE)]
    assert not missing, f"docs/scenario.md does not name {missing}"


def test_the_example_of_the_reference_can_be_run(tmp_path: Path) -> None:
    example = re.search(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    assert example is not None
    file = tmp_path / "reference.toml"
    file.write_text(example.group(1), encoding="utf-8")
    prepared = prepare(file, lambda _: None)
    assert prepared.mission.team == "my_mission"
    assert len(prepared.mission.robots) == 5

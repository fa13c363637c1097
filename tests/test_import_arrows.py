"""The arrows of docs/architecture.md: who may import whom, read from the source."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
ALLOWED = {
    "planning": {"planning"},
    "estimation": {"estimation"},
    "protocol": {"protocol"},
    "maps": {"maps"},
    "agents": {"agents", "planning", "estimation", "protocol"},
    "launcher": {"launcher", "agents", "planning", "estimation", "protocol", "maps"},
}
RECORDINGS = {
    "agents/recorder.py",
    "agents/recorder_columns.py",
    "agents/recorder_estimate.py",
    "agents/recorder_file.py",
    "agents/recorder_layout.py",
    "agents/recorder_style.py",
    "launcher/review.py",
}
GATES = {
    "zenoh": {"protocol/zenoh_bus.py", "protocol/zenoh_settings.py", "protocol/security.py"},
    "rerun": RECORDINGS,
    "rerun_bindings": RECORDINGS,
}


@cache
def imported(file: Path) -> list[tuple[int, str]]:
    """Line and top-level package of every import, however deep in the file it stands."""
    found = []
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found += [(node.lineno, alias.name.split(".")[0]) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file}:{node.lineno}: write imports in full"
            found.append((node.lineno, (node.module or "").split(".")[0]))
    return found


@pytest.mark.parametrize("package", sorted(ALLOWED))
def test_packages_import_only_along_the_arrows(package: str) -> None:
    files = sorted((ROOT / package).rglob("*.py"))
    assert files, f"package {package} is missing"
    for file in files:
        for line, name in imported(file):
            assert name not in ALLOWED or name in ALLOWED[package], f"{file}:{line}: {package} may not import {name}"
            assert name != "tests", f"{file}:{line}: the product does not import its tests"


@pytest.mark.parametrize("library", sorted(GATES))
def test_sockets_and_recordings_have_one_door_each(library: str) -> None:
    for package in ALLOWED:
        for file in sorted((ROOT / package).rglob("*.py")):
            place = file.relative_to(ROOT).as_posix()
            if place not in GATES[library]:
                for line, name in imported(file):
                    assert name != library, f"{place}:{line}: only {sorted(GATES[library])} may import {library}"


def test_roles_and_planners_know_no_clock_socket_or_thread() -> None:
    pure = [*sorted((ROOT / "planning").glob("*.py")), *sorted((ROOT / "estimation").glob("*.py"))]
    pure += [ROOT / "agents" / f"{name}.py" for name in ("role", "robot", "tracked_agent", "base_station", "leader")]
    for file in pure:
        for line, name in imported(file):
            assert name not in {"time", "socket", "threading", "asyncio", "subprocess", "random"}, (
                f"{file}:{line}: a pure core may not import {name}"
            )

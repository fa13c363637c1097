"""The page on motion says what comes out: its commands and its Python are run, and their numbers compared."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from launcher.cli import app

PAGE = (Path(__file__).parents[2] / "docs" / "motion.md").read_text(encoding="utf-8")


def test_python_of_the_page() -> None:
    names: dict[str, object] = {}
    promised = 0
    for example in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL):
        for line in example.splitlines():
            code, _, comment = line.partition("  # ")
            said = re.match(r"-?\d+(\.\d+)?|True|False|'\w+'", comment)
            if said:
                expected = ast.literal_eval(said[0])
                found = eval(code, names)
                assert found == (pytest.approx(expected, rel=0.02) if isinstance(expected, float) else expected), line
                promised += 1
            else:
                exec(code, names)
    assert promised >= 5


def test_the_command_of_the_page_answers_as_it_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (command,) = re.findall(r"^    sightline (plan .*)$", PAGE, re.MULTILINE)
    result = CliRunner().invoke(app, command.split())
    assert result.exit_code == 0, result.output
    assert {file.name for file in tmp_path.iterdir()} == {"plan.png", "pair.png"}
    (quoted,) = re.findall(r"^    (Motion: .*?)\.\.\.$", PAGE, re.MULTILINE | re.DOTALL)
    for line in quoted.strip().splitlines():
        words = re.sub(r"[\d.]+", "#", line.strip())
        assert words in re.sub(r"[\d.]+", "#", result.stdout), line

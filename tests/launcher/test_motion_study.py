"""The study of motion: its tasks, its judgements, and the page that quotes it."""

from __future__ import annotations

import csv
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from launcher import picture
from launcher.cli import app
from launcher.studies import drawing, motion
from launcher.studies.motion import study_motion
from launcher.studies.motion_runs import AT_ONCE, METHODS, OURS, Ground, Journey, answer, find_journeys
from launcher.studies.motion_tasks import Question, draw_tasks
from launcher.studies.redeployment_runs import RADIUS_M, load_ground
from planning.connectivity import connected
from planning.motion_plan import Schedule


@pytest.fixture(autouse=True)
def coarse_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drawing, "DOTS_PER_IN", 30)
    monkeypatch.setattr(picture, "_DOTS_PER_IN", 30)


@pytest.fixture(scope="module")
def small() -> Ground:
    return Ground(load_ground("l457mod", "aspect"))


def is_kept(ground: Ground, journey: Journey, schedule: Schedule, number: int = 150) -> tuple[bool, bool]:
    """By samples: whether the network is whole, and whether no discs overlap."""
    places = schedule.positions(np.linspace(schedule.start_s, schedule.end_s, number))
    whole = all(connected(ground.graph.environment.visibility_matrix(now)) for now in places)
    apart = np.linalg.norm(places[:, 1:, None] - places[:, None, 1:], axis=3)  # the base has no body
    return whole, bool((apart[:, *np.triu_indices(apart.shape[1], 1)] >= 2 * RADIUS_M - 1e-6).all())


@pytest.mark.parametrize("kind", ["aspect", None])
def test_tasks_are_deployments_one_after_the_other(kind: str | None) -> None:
    graph = load_ground("l457mod", kind)  # type: ignore[arg-type]
    question = Question(6, near=kind is None)
    tasks, again = (list(draw_tasks(graph, question, 12, 5)) for _ in range(2))
    for one, other in zip(tasks, again, strict=True):
        np.testing.assert_array_equal(one.goals, other.goals)
    for task in tasks:
        for tree, places in ((task.tree, task.starts), (task.next_tree, task.goals)):
            assert tree.shape == (5, 2)
            links = np.zeros((6, 6), dtype=bool)
            links[tree[:, 0], tree[:, 1]] = True
            assert connected(links | links.T)
            assert graph.environment.line_of_sight(places[tree[:, 0]], places[tree[:, 1]]).all()
            assert graph.free.contains(places).all()
            apart = np.linalg.norm(places[:, None] - places, axis=2) + np.eye(6)
            assert apart.min() >= 2 * RADIUS_M
        np.testing.assert_array_equal(task.starts[0], task.goals[0])
        assert np.any(task.starts[1] != task.goals[1])
    follows = [np.array_equal(one.goals, two.starts) for one, two in pairwise(tasks)]
    assert follows == [True] * 9 + [False] + [True]


def test_what_is_said_of_motions_is_what_samples_show(small: Ground) -> None:
    outcomes = []
    for journey in find_journeys(small, Question(6), 10, 3):
        once, ours = answer(small, journey).outcomes[AT_ONCE], journey.plan_ours(small)
        whole, apart = is_kept(small, journey, journey.go_at_once())
        assert (once.kept, once.collided) == (whole and apart, not apart)
        assert (once.broken_s > 0.0) == (not whole)
        assert is_kept(small, journey, ours.schedule) == (True, True)
        np.testing.assert_array_equal(ours.schedule.positions([ours.schedule.end_s])[0], journey.goals)
        outcomes.append(once.kept)
    assert 0 < sum(outcomes) < len(outcomes)


def test_an_independent_agent_is_none_of_the_team(small: Ground) -> None:
    journeys = list(find_journeys(small, Question(5, governed=False), 4, 1))
    assert len(journeys) == 4
    for journey in journeys:
        assert journey.members == ("base", "robot 1", "robot 2", "robot 3")
        assert journey.is_joined


@pytest.mark.timeout(180)  # some seconds on an idle machine, most of it figures
def test_the_motion_study_in_short(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motion, "EXAMPLE", "l457mod")
    monkeypatch.setattr(motion, "NODES", (4, 6))
    text = study_motion(tmp_path, 3, 3, (("l457mod", "aspect"),), lambda _: None)
    assert (tmp_path / "summary.md").read_text(encoding="utf-8") == text
    assert {file.name for file in tmp_path.glob("*.png")} == {"kept.png", "times.png", "example.png"}
    rows = list(csv.DictReader((tmp_path / "motions.csv").read_text(encoding="utf-8").splitlines()))
    assert len(rows) == 3 * 2 + 2 * len(motion.VARIATIONS)
    some = [row for row in rows if row["question"] == "governed agent" and row["nodes"] == "6"]
    shares = " · ".join(f"{100 / 3 * sum(row[f'{method} kept'] == 'True' for row in some):.0f}" for method in METHODS)
    assert f"| {shares} |" in text
    for row in rows:
        if row[f"{OURS} kept"] == "True":
            assert float(row[f"{OURS} length_m"]) >= float(row["geodesic_m"]) - 1e-5
            assert float(row[f"{OURS} duration_s"]) >= float(row["fastest_s"]) - 1e-5


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = {}

    def study(folder: Path, number: int, seed: int, tell: object) -> str:
        asked.update(folder=folder, number=number, seed=seed)
        return "what came out"

    monkeypatch.setattr("launcher.studies.motion.study_motion", study)
    monkeypatch.setattr("launcher.kernels.warm_up", lambda *_: False)
    options = ["--number", "7", "--seed", "3", "--output", str(tmp_path / "made")]
    result = CliRunner().invoke(app, ["study", "motion", *options])
    assert result.exit_code == 0, result.output
    assert asked == {"folder": tmp_path / "made", "number": 7, "seed": 3}
    assert "what came out" in result.output

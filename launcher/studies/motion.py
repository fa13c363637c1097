"""The study of motion: how often a team keeps its network on the way from one deployment to the next, and at what cost.

The thesis executes geodesics as deployments come (§4.4.2), and can keep fixed links only (§4.3.5).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from launcher.studies import drawing
from launcher.studies.motion_figures import draw_example, draw_kept, draw_times, share_kept
from launcher.studies.motion_runs import (
    AT_ONCE,
    HYBRID,
    METHODS,
    OURS,
    SPEED_M_S,
    Ground,
    MotionAnswer,
    answer_all,
    find_journeys,
)
from launcher.studies.motion_tasks import WALK, Question
from launcher.studies.redeployment_runs import GROUNDS, RADIUS_M, load_ground
from launcher.studies.scaling import describe_machine
from launcher.studies.thesis_tables import Kind

NODES = (4, 5, 6, 7, 8)
VARIED = 6
"""k of the variations."""

VARIATIONS = {
    "μ = 5 m": Question(VARIED, mu_m=5.0),
    "agent goes where it sees": Question(VARIED, near=True),
    "independent agent": Question(VARIED, governed=False),
}
"""As the question at this k but for what the name says."""

VARIED_LESS = 3
"""How many times fewer redeployments a variation has."""

EXAMPLE = "room3"
"""Map of the motion that is drawn."""

Answers = Sequence[MotionAnswer]


def study_motion(
    folder: Path,
    number: int = 300,
    seed: int = 0,
    grounds: Sequence[tuple[str, Kind]] = GROUNDS,
    tell: Callable[[str], None] = print,
) -> str:
    """Move teams between random deployments by every method, draw, and say what came out.

    Args:
        folder: is made; files in it of the same names are replaced.
        number: redeployments of each map and k.
        seed: of the random places.
        grounds: maps, each with its kind of cells.
        tell: is told what is being done.

    Returns:
        The text of ``summary.md``.
    """
    folder.mkdir(parents=True, exist_ok=True)
    found: dict[str, dict[int, Answers]] = {}
    varied: dict[str, dict[str, Answers]] = {}
    for name, kind in grounds:
        ground = Ground(load_ground(name, kind))
        title = f"{name}, {len(ground.graph)} {kind} cells"
        tell(f"{title}: {number} redeployments for each k")
        found[title] = {nodes: answer_all(ground, Question(nodes), number, seed) for nodes in NODES}
        varied[title] = {
            variation: answer_all(ground, question, max(2, number // VARIED_LESS), seed)
            for variation, question in VARIATIONS.items()
        }
        if name == EXAMPLE:
            _draw_telling(ground, found[title][VARIED], number, seed, folder / "example.png")
    tell("figures")
    draw_kept(found, folder / "kept.png")
    draw_times(found, folder / "times.png")
    _write_tables(folder, found, varied)
    text = sum_up(found, varied, number)
    (folder / "summary.md").write_text(text, encoding="utf-8")
    return text


def _draw_telling(ground: Ground, answers: Answers, number: int, seed: int, file: Path) -> None:
    """Of the motions that only ours keeps, the one in which most members move; of these the longest."""

    def telling(place: int) -> tuple[bool, bool, int, float]:
        one = answers[place]
        return (
            one.outcomes[OURS].kept,
            not any(one.outcomes[method].kept for method in (AT_ONCE, HYBRID)),
            one.movers,
            one.geodesic_m,
        )

    place = max(range(len(answers)), key=telling)
    journey = next(islice(find_journeys(ground, Question(VARIED), number, seed), place, None))
    motion = journey.plan_ours(ground)
    title = f"{EXAMPLE}, k = {VARIED}: a motion of the study ({motion.way})"
    draw_example(ground, journey, motion.schedule, file, title)


def sum_up(found: Mapping[str, Mapping[int, Answers]], varied: Mapping[str, Mapping[str, Answers]], number: int) -> str:
    """The text of ``summary.md``."""
    by_nodes = {nodes: [one for some in found.values() for one in some[nodes]] for nodes in NODES}
    everything = [one for answers in by_nodes.values() for one in answers]
    parts = [
        "# Motion study\n",
        f"{number} random redeployments for each map and k: a base, an agent and k − 2 robots, discs of {RADIUS_M:g} m "
        f"at {SPEED_M_S:g} m/s, go from one deployment of least cost on cells to the next, {WALK} with each base. A "
        "motion *keeps* the network if the certificate finds no overlap and all k members in one network of lines of "
        "sight throughout, the agent included, which moves by the schedule as the others do.\n",
        "## Kept throughout, in %\n",
        f"{AT_ONCE} · {HYBRID} · {OURS}\n",
        _table(
            ("map", *(f"k = {nodes}" for nodes in NODES)),
            [(name, *(_shares(some[nodes]) for nodes in NODES)) for name, some in found.items()]
            + [("all", *(_shares(answers) for answers in by_nodes.values()))],
        ),
        _describe(everything),
        "## Ours by k, all maps\n",
        _table(
            (
                "k",
                "planning: median",
                "99 %",
                "certificate: median",
                "longer than geodesics: median",
                "90 %",
                "slower than all at once: median",
                "90 %",
                *WAYS,
            ),
            [(str(nodes), *_costs(answers), *_ways(answers)) for nodes, answers in by_nodes.items()],
        ),
        "Longer and slower are of the motions that are kept; the last columns are the share of all. Times are "
        f"processor times of one thread of {describe_machine()}.\n",
        f"## Otherwise, k = {VARIED}: kept in %\n",
        f"{max(2, number // VARIED_LESS)} redeployments for each map.\n",
        _table(
            ("map", "as above", *VARIATIONS),
            [
                (name, _shares(found[name][VARIED]), *(_shares(some[variation]) for variation in VARIATIONS))
                for name, some in varied.items()
            ],
        ),
        "An *independent agent* goes as it pleases: base and robots are to be one network without it, and cases in "
        "which they are not, before or afterwards, are drawn again.\n",
    ]
    return "\n".join(parts)


WAYS = ("direct", "detour", "bridge", "stepwise", "parted")


def _describe(answers: Answers) -> str:
    """What becomes of those that are not kept."""
    once, hybrid = ([one.outcomes[method] for one in answers] for method in (AT_ONCE, HYBRID))
    collided = np.mean([one.collided for one in once])
    broken = [one.broken_s / one.duration_s for one in once if one.broken_s > 0.0]
    refused = Counter(one.way for one in hybrid if not one.kept)
    return (
        f"*At once*, robots collide in {collided:.0%} of the redeployments, and the network is parted in "
        f"{len(broken) / len(once):.0%}, for {np.median(broken or [0.0]):.0%} of the time in the median of these. "
        f"*Hybrid* finds no schedule for the links before nor for those afterwards in "
        f"{refused['proven'] / len(hybrid):.0%}, and gives up in {refused['given up'] / len(hybrid):.0%}.\n"
    )


def _costs(answers: Answers) -> Iterator[str]:
    ours = [one.outcomes[OURS] for one in answers]
    kept = [one for one in answers if one.outcomes[OURS].kept]
    planning = np.array([one.planning_s for one in ours])
    yield from (f"{1e3 * np.quantile(planning, share):.1f} ms" for share in (0.5, 0.99))
    yield f"{1e3 * np.median([one.certifying_s for one in ours]):.1f} ms"
    longer = [one.outcomes[OURS].length_m / one.geodesic_m - 1.0 for one in kept]
    slower = [one.outcomes[OURS].duration_s / one.fastest_s - 1.0 for one in kept]
    for more in (longer, slower):
        yield from (f"{np.quantile(more or [np.nan], share):+.0%}" for share in (0.5, 0.9))


def _ways(answers: Answers) -> Iterator[str]:
    counts = Counter(one.outcomes[OURS].way for one in answers)
    return (f"{counts[way] / len(answers):.1%}" for way in WAYS)


def _shares(answers: Answers) -> str:
    return " · ".join(f"{100.0 * share_kept(answers, method):.0f}" for method in METHODS)


def _write_tables(
    folder: Path, found: Mapping[str, Mapping[int, Answers]], varied: Mapping[str, Mapping[str, Answers]]
) -> None:
    measures = ("kept", "collided", "broken_s", "planning_s", "certifying_s", "duration_s", "length_m", "way")
    columns = [f"{method} {measure}" for method in METHODS for measure in measures]
    rows = [
        (
            *names, number, one.movers, one.fastest_s, one.geodesic_m,
            *(getattr(one.outcomes[method], measure) for method in METHODS for measure in measures),
        )
        for *names, answers in _sets(found, varied)
        for number, one in enumerate(answers)
    ]  # fmt: skip
    head = ("map", "question", "nodes", "number", "movers", "fastest_s", "geodesic_m")
    drawing.write_table(folder / "motions.csv", (*head, *columns), rows)


def _sets(
    found: Mapping[str, Mapping[int, Answers]], varied: Mapping[str, Mapping[str, Answers]]
) -> Iterator[tuple[str, str, int, Answers]]:
    for name, by_nodes in found.items():
        for nodes, answers in by_nodes.items():
            yield name, "governed agent", nodes, answers
        for variation, answers in varied[name].items():
            yield name, variation, VARIED, answers


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return "\n".join("| " + " | ".join(row) + " |" for row in (head, ["---"] * len(head), *rows)) + "\n"

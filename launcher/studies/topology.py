"""The study of topology: trees by the leader's optimum and by the auction of all, over the same simulated missions."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, fields
from itertools import product
from pathlib import Path
from statistics import mean, median
from typing import TYPE_CHECKING, Final

from msgspec import structs

from agents.casting import Casting
from agents.mission import Mission, Wandering
from agents.records import AnyRecord
from launcher.mission_trace import MissionTrace
from launcher.preparation import prepare
from launcher.report import measure
from launcher.scenario import find_scenario
from launcher.simulated_peer import SimulatedPeer
from launcher.simulation import SimulatedTeam
from launcher.studies import drawing
from protocol.keys import route
from protocol.messages import Method

if TYPE_CHECKING:
    from agents.leader import DeploymentPlanner
    from planning.environment import Environment

SCENARIOS: Final = ("room3", "maze", "office")
METHODS: Final[tuple[Method, ...]] = ("optimum", "auction")
LOSSES: Final = (0.0, 0.2)
"""Probabilities that a peer misses a message."""

KINDS: Final = frozenset({"topology", "confirmation", "auction", "bid"})
"""What negotiating says."""


@dataclass(frozen=True)
class Outcome:
    """One mission by one method."""

    scenario: str
    method: Method
    seed: int
    loss: float
    chain_share: float
    """Of the time since the first deployment, in which base and agent were joined by true lines of sight."""
    changes: int
    """Proposals that came into force."""
    given_up: int
    new_links: float
    """Per change, mean."""
    cost_m: float
    """Of the chains decided on with a change of topology, mean of what the leader minimises; 0 without one."""
    rounds: int
    """Most of one proposal."""
    commit_ms: float
    """From the first word of a proposal to its tree in force: median."""
    slowest_ms: float
    driven_m: float
    """By all robots."""
    messages_per_s: float
    """Said by all, of :data:`KINDS`."""
    bytes_per_s: float


def study_topology(
    folder: Path,
    seeds: int = 2,
    duration_s: float = 60.0,
    scenarios: Sequence[str] = SCENARIOS,
    losses: Sequence[float] = LOSSES,
    tell: Callable[[str], None] = print,
) -> str:
    """Live through the same missions by both methods, and say what came out.

    Args:
        folder: is made; files in it of the same names are replaced.
        seeds: missions of each scenario and loss.
        duration_s: of each, virtual.
        scenarios: packaged ones; their agents wander, and announce where.
        losses: of messages.
        tell: is told what is being done.

    Returns:
        The text of ``summary.md``.
    """
    folder.mkdir(parents=True, exist_ok=True)
    outcomes: list[Outcome] = []
    for scenario in scenarios:
        ready = prepare(find_scenario(scenario), lambda _text: None)
        for method in METHODS:
            tell(f"{scenario}, {method}: {seeds * len(losses)} missions of {duration_s:g} s")
            mission = structs.replace(
                ready.mission, behaviour=Wandering(around_corner_share=0.5), announces=True, topology=method
            )
            planner = Casting(mission, ready.environment).planner()
            outcomes += [
                live_through(
                    scenario, structs.replace(mission, seed=seed), ready.environment, planner, loss, duration_s
                )
                for loss, seed in product(losses, range(seeds))
            ]
    columns = [field.name for field in fields(Outcome)]
    drawing.write_table(folder / "missions.csv", columns, [astuple(outcome) for outcome in outcomes])
    text = sum_up(outcomes, seeds, duration_s)
    (folder / "summary.md").write_text(text, encoding="utf-8")
    return text


def live_through(
    scenario: str,
    mission: Mission,
    environment: Environment,
    planner: DeploymentPlanner,
    loss: float,
    duration_s: float,
) -> Outcome:
    """One mission, and its figures."""
    records: list[tuple[float, str, AnyRecord]] = []
    said: Counter[str] = Counter()
    sizes: Counter[str] = Counter()

    def count(_peer: SimulatedPeer, key: str, payload: bytes) -> None:
        kind, _ = route(key)
        said[kind] += 1
        sizes[kind] += len(payload)

    casting = Casting(mission, environment, planner)
    team = SimulatedTeam(mission, casting, lambda at_s, peer, what: records.append((at_s, peer, what)), loss=loss)
    for peer in team.peers.values():
        peer.said = count
    team.time.run_until(duration_s)
    metrics = measure(MissionTrace.of(records, mission, duration_s), environment)
    made = [proposal for proposal in metrics.trees if proposal.in_force]
    costs = [change.total_cost_m for change in metrics.topology_changes if change.total_cost_m is not None]
    since = metrics.since_first_deployment
    return Outcome(
        scenario=scenario,
        method=mission.topology,
        seed=mission.seed,
        loss=loss,
        chain_share=0.0 if since is None else since.chain_connected,
        changes=len(made),
        given_up=len(metrics.trees) - len(made),
        new_links=mean([len(proposal.new) for proposal in made] or [0]),
        cost_m=mean(costs or [0.0]),
        rounds=max((proposal.rounds for proposal in metrics.trees), default=0),
        commit_ms=1e3 * median([proposal.duration_s for proposal in made] or [0.0]),
        slowest_ms=1e3 * max((proposal.duration_s for proposal in made), default=0.0),
        driven_m=metrics.total_distance_m,
        messages_per_s=sum(said[kind] for kind in KINDS) / duration_s,
        bytes_per_s=sum(sizes[kind] for kind in KINDS) / duration_s,
    )


def sum_up(outcomes: Sequence[Outcome], seeds: int, duration_s: float) -> str:
    """The text of ``summary.md``."""
    parts = [
        "# Topology study\n",
        f"{seeds} missions of {duration_s:g} s for each scenario, loss and method; the agent wanders and announces its "
        "way. Means, but for the worst.\n",
        "| scenario | loss | method | joined, % (worst) | changes | given up | new links a change | cost, m "
        "| driven, m | to commit, ms (worst) | rounds | messages/s | kB/s |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    names = dict.fromkeys(outcome.scenario for outcome in outcomes)
    losses = dict.fromkeys(outcome.loss for outcome in outcomes)
    for scenario, loss, method in product((*names, "all"), losses, METHODS):
        own = [
            outcome
            for outcome in outcomes
            if outcome.scenario in (scenario, outcome.scenario if scenario == "all" else "")
            and (outcome.loss, outcome.method) == (loss, method)
        ]
        shares = [100 * outcome.chain_share for outcome in own]
        costs = [outcome.cost_m for outcome in own if outcome.cost_m > 0.0]
        cells = (
            scenario, f"{100 * loss:g} %", method, f"{mean(shares):.1f} ({min(shares):.1f})",
            f"{mean(outcome.changes for outcome in own):.1f}", f"{mean(outcome.given_up for outcome in own):.1f}",
            f"{mean(outcome.new_links for outcome in own):.1f}", f"{mean(costs or [0.0]):.1f}",
            f"{mean(outcome.driven_m for outcome in own):.0f}",
            f"{mean(outcome.commit_ms for outcome in own):.0f} ({max(outcome.slowest_ms for outcome in own):.0f})",
            str(max(outcome.rounds for outcome in own)),
            f"{mean(outcome.messages_per_s for outcome in own):.1f}",
            f"{1e-3 * mean(outcome.bytes_per_s for outcome in own):.1f}",
        )  # fmt: skip
        parts.append("| " + " | ".join(cells) + " |")
    return "\n".join(parts) + "\n"

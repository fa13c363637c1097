"""The figures of missions as tables for a terminal."""

from __future__ import annotations

from rich.console import Group
from rich.table import Table

from launcher.contacts import Overlap
from launcher.reigns import Takeover
from launcher.report import Metrics, Shares
from launcher.report_estimate import EstimateFigures
from launcher.report_trees import describe_trees, tabulate_trees
from launcher.spells import Spell
from launcher.wording import counted


def render(metrics: Metrics) -> Group:
    """The figures as tables for a terminal."""
    shares = Table("share of time", "whole run", "since first deployment", title="Connected by true line of sight")
    since = metrics.since_first_deployment
    for title, key in (
        ("agent visible to some robot or the base", "agent_visible"),
        ("agent-base chain connected", "chain_connected"),
        ("whole team connected", "team_connected"),
    ):
        shares.add_row(title, _percent(metrics.whole_run, key), "-" if since is None else _percent(since, key))
    figures = Table.grid(padding=(0, 2))
    planning = metrics.planning
    for title, value in (
        ("duration", f"{metrics.duration_s:.1f} s"),
        (
            "first deployment",
            "none" if metrics.first_deployment_s is None else f"at {metrics.first_deployment_s:.2f} s of mission time",
        ),
        (
            "robots used as relays",
            f"{metrics.robots_used} of {metrics.robots}, {metrics.relays_at_most} at most at a time",
        ),
        (
            "distance driven",
            f"{metrics.total_distance_m:.1f} m: "
            + ", ".join(f"{peer} {metres:.1f} m" for peer, metres in metrics.distance_m.items()),
        ),
        ("distance of the agent", f"{metrics.agent_distance_m:.1f} m"),
        (
            "planning",
            "none"
            if planning is None
            else f"{planning.count} jobs, median {1e3 * planning.median_s:.1f} ms, "
            f"95 % within {1e3 * planning.p95_s:.1f} ms, longest {1e3 * planning.max_s:.1f} ms",
        ),
        ("decisions", f"{metrics.decisions}, {len(metrics.topology_changes)} of them changed the topology"),
        ("tree", describe_trees(metrics.trees)),
        ("motion", _describe_motion(metrics)),
        *_describe_estimate(metrics.estimate),
        ("leaders", _describe_reigns(metrics.reigns)),
        *(("takeover", _describe_takeover(takeover)) for takeover in metrics.takeovers),
        *(("rules of leading", text) for text in _describe_rules(metrics)),
        ("overlapping robots", _describe_contacts(metrics.overlaps)),
        ("robots at the agent", _describe_contacts(metrics.agent_contacts) + ", as it goes where it likes"),
        ("log", f"{metrics.warnings} warnings, {metrics.errors} errors, in the recording and in logs/"),
    ):
        figures.add_row(title, value)
    parts: list[Table] = [shares, figures]
    if metrics.topology_changes:
        changes = Table("time", "decision", "reason", "cost", "at least", title="Topology changes")
        for change in metrics.topology_changes:
            costs = (_metres(change.total_cost_m), _metres(change.lower_bound_m))
            changes.add_row(f"{change.time_s:.2f} s", str(change.decision), change.reason, *costs)
        parts.append(changes)
    if metrics.trees:
        parts.append(tabulate_trees(metrics.trees))
    return Group(*parts)


def _describe_motion(metrics: Metrics) -> str:
    if metrics.certified is None:
        return "none"
    certified = metrics.certified
    plans = f"{counted(metrics.plans, 'plan')}, {counted(metrics.motions - metrics.plans, 'revision')}"
    text = f"{plans}; certified as one network {100 * certified.team:.1f} % of the time"
    if metrics.estimate is not None:  # nobody is told of the agent's next moments
        return text
    return f"{text}, with the agent's next moments {100 * certified.agent:.1f} %"


def _describe_estimate(figures: EstimateFigures | None) -> list[tuple[str, str]]:
    """Rows about the estimate; none where the agent announces."""
    if figures is None:
        return []
    equal = "" if figures.equal is None else f"; all peers' equal {100.0 * figures.equal:.1f} % of the time"
    return [
        (
            "estimate of the agent",
            f"{figures.error_median_m:.2f} m off in the median, 95 % within {figures.error_p95_m:.2f} m; "
            f"{figures.area_median_m2:.1f} m² in the median, 95 % within {figures.area_p95_m2:.1f} m²; "
            f"95 % no older than {figures.age_p95_s:.1f} s",
        ),
        ("agent inside it", f"{100.0 * figures.contained:.1f} % of {figures.records} sets of all peers{equal}"),
        (
            "ranges",
            f"{figures.ranges} measured, a peer lacks {100.0 * figures.unshared:.1f} % at the end; "
            f"{figures.late} came too late",
        ),
    ]


def _describe_reigns(reigns: tuple[Spell, ...]) -> str:
    if not reigns:
        return "none"
    return ", ".join(f"{spell.peer} {spell.from_s:.1f}–{spell.until_s:.1f} s" for spell in reigns)


def _describe_rules(metrics: Metrics) -> list[str]:
    if metrics.leading_faults is None or not metrics.reigns:
        return []
    if metrics.leading_faults:
        return [f"broken {counted(len(metrics.leading_faults), 'time')}: {metrics.leading_faults[0]}"]
    return [
        "kept: one leader at a time, orders in office only and taken in time and in their order, trees that join whom "
        "they name, in force when both ends of each new link had confirmed it, and nobody let go on before"
    ]


def _describe_takeover(takeover: Takeover) -> str:
    back = "" if takeover.back_after_s is None else f"; {takeover.before} was back after {takeover.back_after_s:.1f} s"
    if takeover.took_s is None:
        return f"{takeover.at_s:.1f} s: {takeover.what}, and nobody was obeyed by all others from then on{back}"
    others = f"all others obeyed {takeover.after} after {takeover.took_s:.2f} s"
    return f"{takeover.at_s:.1f} s: {takeover.what}; {others}{back}"


def _describe_contacts(contacts: tuple[Overlap, ...]) -> str:
    if not contacts:
        return "never"
    seconds = sum(contact.seconds for contact in contacts)
    times = counted(sum(contact.episodes for contact in contacts), "time")
    return f"{times}, {seconds:.1f} s in all, {counted(len(contacts), 'pair')}"


def _metres(length_m: float | None) -> str:
    return "-" if length_m is None else f"{length_m:.1f} m"


def _percent(shares: Shares, key: str) -> str:
    return f"{100.0 * float(getattr(shares, key)):.1f} %"

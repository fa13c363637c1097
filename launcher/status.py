"""How the state of a team is shown while it runs: a table that is redrawn on a terminal, single lines elsewhere."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator

from rich.console import Console
from rich.live import Live
from rich.table import Table
from rich.text import Text

from agents.mission import Mission
from launcher.console import tell
from launcher.observer import Status
from launcher.wording import counted
from protocol.messages import Point

LINE_S = 5.0
"""Where there is no terminal: how often it says how the team is; a chain that breaks or holds again is said at once."""

_COLOURS = {
    "moving": "cyan",
    "arrived": "green",
    "yielding": "blue",
    "retreating": "magenta",
    "holding": "yellow",
    "lost": "red",
    "starting": "dim",
    "waiting": "dim",
}


@contextlib.contextmanager
def shown(mission: Mission, console: Console) -> Iterator[Callable[[Status, float], None]]:
    """A function that shows a status: redrawn in place on a terminal, lines now and then elsewhere."""
    if console.is_terminal:
        with Live(console=console, auto_refresh=False, transient=True) as live:
            yield lambda status, now_s: live.update(draw(status, mission, now_s), refresh=True)
        return
    said: tuple[float, bool] = (-LINE_S, False)

    def say(status: Status, now_s: float) -> None:
        nonlocal said
        if now_s >= said[0] + LINE_S or status.chain_connected != said[1]:
            said = (now_s, status.chain_connected)
            tell(describe(status, mission, now_s), console)

    yield say


def describe(status: Status, mission: Mission, now_s: float) -> str:
    """The team in one line."""
    up = f"{now_s:6.1f} s  {status.up}/{len(status.peers)} up"
    if status.deployment is None:
        return f"{up}, starting"
    chain = f"{_chain(status)} {'connected' if status.chain_connected else 'broken'}"
    leads = f", {_leads(status, mission)}"
    sight = "" if status.chain_connected else ", agent visible" if status.agent_visible else ", agent out of sight"
    if status.agent_visible is None:
        sight = f", agent {_whereabouts(status)}"
    goal = f", agent to {_place(status.goal)}" if status.goal else ""
    return f"{up}{leads}, {chain}{sight}, {_relays(status)}, {counted(status.links, 'line')} of sight{goal}"


def draw(status: Status, mission: Mission, now_s: float) -> Table:
    """The team as a table."""
    length = f" of {mission.duration_s:g} s" if mission.duration_s is not None else " s, Ctrl-C ends the run"
    chain = Text(f"{_chain(status)} broken", "bold red")
    if status.chain_connected:
        chain = Text(f"{_chain(status)} connected", "bold green")
    sight = Text("agent visible", "green") if status.agent_visible else Text("agent out of sight", "red")
    if status.agent_visible is None:
        sight = Text(f"agent {_whereabouts(status)}")
    leads = Text(_leads(status, mission), "" if _leader(status) else "bold red")
    words = [Text("starting", "dim")] if status.deployment is None else [leads, chain, sight]
    table = Table(
        title=Text(" · ").join([Text(f"{mission.team}  {now_s:.0f}{length}"), *words]),
        title_justify="left",
        caption=Text(_deployment(status)),
        caption_justify="left",
        box=None,
        pad_edge=False,
        expand=True,  # else title and caption wrap at the width of the columns
    )
    for heading in ("peer", "does", "place", "task"):
        table.add_column(heading, min_width=10)
    spare = (
        {placement.robot: placement.spare for placement in status.deployment.placements} if status.deployment else {}
    )
    for peer, entry in zip(status.peers, mission.roster, strict=True):
        walk = f"walks to {_place(status.goal)}" if status.goal else "has no goal"
        walk = walk if mission.announces else _whereabouts(status)
        task = {"base_station": "base station", "tracked_agent": walk}.get(entry.role, "")
        if entry.role == "robot" and peer.name in spare:
            task = "spare" if spare[peer.name] else "relay"
        table.add_row(peer.name, Text(peer.mode, _COLOURS.get(peer.mode, "")), _place(peer.position), task)
    return table


def _deployment(status: Status) -> str:
    deployment = status.deployment
    if deployment is None:
        return "no deployment yet"
    return f"deployment {deployment.decision}: {deployment.reason}"


def _chain(status: Status) -> str:
    """What is known to be connected: not as far as an agent of which nobody knows whether it is in sight."""
    return "chain to the relays" if status.agent_visible is None else "chain"


def _leader(status: Status) -> str | None:
    """Who leads; nobody, if it is not there, though its lease may still run."""
    return status.leader if any(peer.up and peer.name == status.leader for peer in status.peers) else None


def _leads(status: Status, mission: Mission) -> str:
    """Who leads; if nobody can, why."""
    if leader := _leader(status):
        return f"{leader} leads"
    voters = mission.voters
    there = sum(peer.up for peer in status.peers if peer.name in voters.voters)
    if there >= voters.majority:
        return "nobody leads"
    return f"nobody leads ({there} of {len(voters.voters)} voters up, {voters.majority} needed)"


def _relays(status: Status) -> str:
    return counted(status.relays, "relay")


def _whereabouts(status: Status) -> str:
    """What is known of an agent that tells nothing."""
    target = status.estimate
    return "not heard of yet" if target is None else f"within {target.area_m2:.1f} m² at {_place(target.center)}"


def _place(point: Point | None) -> str:
    return f"{point[0]:.1f}, {point[1]:.1f}" if point is not None else "–"

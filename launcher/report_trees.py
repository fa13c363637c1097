"""How the team's tree was negotiated in a mission: each proposal, and what became of it."""

from __future__ import annotations

import msgspec
from rich.table import Table

from launcher.mission_trace import MissionTrace
from protocol.messages import Edge, Method
from protocol.topology import in_words


class SettledProposal(msgspec.Struct, frozen=True, kw_only=True):
    """A proposal for another tree that is not open any more."""

    time_s: float
    """When it was settled."""
    leader: str
    epoch: int
    number: int
    """In this epoch."""
    in_force: bool
    """Whether its tree is in force since; else the one before stayed so."""
    new: tuple[Edge, ...]
    """Links that had to be confirmed."""
    released: tuple[Edge, ...]
    """Links of the tree before that it does without."""
    method: Method
    rounds: int
    """How often it was said."""
    duration_s: float
    reason: str
    """Why it was made, or why it was given up."""


def settled_proposals(trace: MissionTrace) -> tuple[SettledProposal, ...]:
    """All proposals of a mission, in the order in which they were settled."""
    return tuple(
        SettledProposal(
            time_s=time_s, leader=leader, epoch=change.number[0], number=change.number[1], in_force=change.committed,
            new=change.new, released=change.released, method=change.method, rounds=change.rounds,
            duration_s=change.duration_s, reason=change.reason,
        )
        for time_s, leader, change in trace.trees
    )  # fmt: skip


def describe_trees(proposals: tuple[SettledProposal, ...]) -> str:
    """Proposals in one line."""
    if not proposals:
        return "none negotiated"
    made = [proposal for proposal in proposals if proposal.in_force]
    rounds = max(proposal.rounds for proposal in proposals)
    longest_s = max((proposal.duration_s for proposal in made), default=0.0)
    return (
        f"{len(made)} of {len(proposals)} proposals came into force, the slowest after {1e3 * longest_s:.0f} ms; "
        f"at most {rounds} round{'' if rounds == 1 else 's'}"
    )


def tabulate_trees(proposals: tuple[SettledProposal, ...]) -> Table:
    """Each proposal, and why it was given up if it was. Why one was made is said of the leader's decision."""
    table = Table("time", "tree", title="The team's tree: proposals by epoch and number")
    table.add_column("new links", overflow="fold")
    table.add_column("rounds")
    table.add_column("took")
    for proposal in proposals:
        links = f"{in_words(proposal.new)} instead of {in_words(proposal.released)}"
        if not proposal.released:
            links = in_words(proposal.new)
        table.add_row(
            f"{proposal.time_s:.2f} s",
            f"{proposal.epoch}.{proposal.number} by {proposal.leader}",
            links if proposal.in_force else f"{in_words(proposal.new)} given up: {proposal.reason}",
            str(proposal.rounds),
            f"{1e3 * proposal.duration_s:.0f} ms",
        )
    return table

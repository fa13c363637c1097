"""What a summary says of the negotiated trees, on a terminal of ordinary width."""

from __future__ import annotations

from io import StringIO

from rich.console import Console

from launcher.report_trees import SettledProposal, tabulate_trees
from protocol.messages import Edge

REASON = "2 relays for the agent at (14.3, 15.4) m and all its way 8.0 m on, places exchanged so that nobody overtakes"


def settled(
    number: int, *, in_force: bool, new: tuple[Edge, ...], released: tuple[Edge, ...], reason: str
) -> SettledProposal:
    return SettledProposal(
        time_s=12.3, leader="robot6", epoch=5, number=number, in_force=in_force, new=new, released=released,
        method="optimum", rounds=1, duration_s=0.084, reason=reason,
    )  # fmt: skip


def test_a_proposal_takes_few_lines_that_name_all_its_links_and_says_why_it_was_given_up() -> None:
    links = (("base", "robot5"), ("robot5", "robot4"), ("robot4", "agent"))
    made = settled(1, in_force=True, new=links, released=(("base", "robot4"),), reason=REASON)
    given_up = settled(
        2, in_force=False, new=links[:1], released=(("base", "robot4"),), reason="robot5 refuses: a wall is between"
    )
    paper = StringIO()
    Console(width=80, file=paper).print(tabulate_trees((made, given_up)))
    lines = paper.getvalue().splitlines()
    assert len(lines) <= 4 + 2 * 3 + 1, "a head of four lines, three for each, and the end"
    cells = " ".join(cell.strip() for line in lines[4:-1] if (cell := line.split("│")[3]))
    assert cells == (
        "base–robot5, robot5–robot4, robot4–agent instead of base–robot4 "
        "base–robot5 given up: robot5 refuses: a wall is between"
    ), paper.getvalue()

"""The diagram of the election in its page, made from the table: ``python -m protocol.election_diagram``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final

from protocol.election_states import TRANSITIONS, Standing

PAGE: Final = Path(__file__).resolve().parent.parent / "docs" / "election.md"
"""Where the diagram stands."""

BEGIN: Final = "<!-- made from protocol/election_states.py: change it there -->\n"
END: Final = "<!-- end -->\n"


def diagram() -> str:
    """The table as a state diagram in Mermaid's language."""
    lines = ["stateDiagram-v2"]
    lines += [f"    [*] --> {state.value}" for state in (Standing.RESTING, Standing.OBSERVING)]
    for before, row in TRANSITIONS.items():
        lines += [f"    {before.value} --> {after.value}: {occurrence.value}" for occurrence, after in row.items()]
    return "```mermaid\n" + "\n".join(lines) + "\n```\n"


def table() -> str:
    """The table as one: a row for each occurrence in each state."""
    rows = ["| in | when | then |", "| --- | --- | --- |"]
    for before, row in TRANSITIONS.items():
        rows += [f"| {before.value} | {occurrence.value} | {after.value} |" for occurrence, after in row.items()]
    return "\n".join(rows) + "\n"


def with_diagram(page: str) -> str:
    """The page with diagram and table as they are now, between the two marks.

    Raises:
        ValueError: the page has not the two marks.
    """
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"{PAGE} lacks the lines between which the diagram goes: {BEGIN.strip()} and {END.strip()}")
    return f"{before}{BEGIN}\n{diagram()}\n{table()}\n{END}{after}"


def main() -> int:
    """Bring the page up to date."""
    PAGE.write_text(with_diagram(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    print(f"{PAGE}: diagram and table of {len(TRANSITIONS)} states")
    return 0


if __name__ == "__main__":
    sys.exit(main())

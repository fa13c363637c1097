"""The diagrams of states in the pages, made from the tables: ``python -m protocol.state_diagrams``."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any, Final

from protocol import election_states, topology_states

_DOCS: Final = Path(__file__).resolve().parent.parent / "docs"

END: Final = "<!-- end -->\n"


@dataclass(frozen=True)
class Page:
    """A page that a table of states stands in."""

    name: str
    """Of the file in ``docs/``."""
    source: str
    """The file that the table stands in."""
    transitions: Mapping[Any, Mapping[Any, Any]]
    """State → occurrence → state."""
    initial: Sequence[Enum]

    @property
    def file(self) -> Path:
        """The page."""
        return _DOCS / self.name

    @property
    def begin(self) -> str:
        """The line after which the diagram stands, up to :data:`END`."""
        return f"<!-- made from {self.source}: change it there -->\n"


PAGES: Final = (
    Page(
        "election.md",
        "protocol/election_states.py",
        election_states.TRANSITIONS,
        (election_states.Standing.RESTING, election_states.Standing.OBSERVING),
    ),
    Page("topology.md", "protocol/topology_states.py", topology_states.TRANSITIONS, (topology_states.Phase.IDLE,)),
)


def diagram(page: Page) -> str:
    """The table as a state diagram in Mermaid's language."""
    lines = ["stateDiagram-v2"]
    lines += [f"    [*] --> {state.value}" for state in page.initial]
    for before, row in page.transitions.items():
        lines += [f"    {before.value} --> {after.value}: {occurrence.value}" for occurrence, after in row.items()]
    return "```mermaid\n" + "\n".join(lines) + "\n```\n"


def table(page: Page) -> str:
    """The table as one: a row for each occurrence in each state."""
    rows = ["| in | when | then |", "| --- | --- | --- |"]
    for before, row in page.transitions.items():
        rows += [f"| {before.value} | {occurrence.value} | {after.value} |" for occurrence, after in row.items()]
    return "\n".join(rows) + "\n"


def with_diagram(page: Page, text: str) -> str:
    """The text of a page with diagram and table as they are now, between the two marks.

    Raises:
        ValueError: the text has not the two marks.
    """
    before, begin, rest = text.partition(page.begin)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(
            f"{page.file} lacks the lines between which the diagram goes: {page.begin.strip()} and {END.strip()}"
        )
    return f"{before}{page.begin}\n{diagram(page)}\n{table(page)}\n{END}{after}"


def main() -> int:
    """Bring the pages up to date."""
    for page in PAGES:
        page.file.write_text(with_diagram(page, page.file.read_text(encoding="utf-8")), encoding="utf-8")
        print(f"{page.file}: diagram and table of {len(page.transitions)} states")
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Where to put the nodes of a deployment tree on paper: the base station on the left, each hop one column further."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence

COLUMN = 130.0
"""Distance between hops, in units of the drawing."""
ROW = 60.0
"""Distance between nodes of the same hop."""


def lay_out(edges: Iterable[tuple[str, str]], root: str, others: Sequence[str] = ()) -> dict[str, tuple[float, float]]:
    """Position of each node: x grows with the number of hops from the root, y spreads the nodes of one hop.

    Nodes that the root does not reach, and those of ``others`` that are in no edge, stand in a row of their own below
    the tree (y points down, as on a screen). Deterministic; linear in nodes and edges.
    """
    neighbours: dict[str, list[str]] = {root: []}
    for one, other in edges:
        neighbours.setdefault(one, []).append(other)
        neighbours.setdefault(other, []).append(one)

    hops = {root: 0}
    queue = deque([root])
    while queue:
        node = queue.popleft()
        for neighbour in sorted(neighbours[node]):
            if neighbour not in hops:
                hops[neighbour] = hops[node] + 1
                queue.append(neighbour)

    columns: dict[int, list[str]] = {}
    for node, hop in hops.items():
        columns.setdefault(hop, []).append(node)
    places = {
        node: (COLUMN * hop, ROW * (row - (len(nodes) - 1) / 2))
        for hop, nodes in columns.items()
        for row, node in enumerate(nodes)
    }
    below = max(y for _, y in places.values()) + 1.5 * ROW
    apart = [node for node in dict.fromkeys((*neighbours, *others)) if node not in places]
    places.update({node: (COLUMN * column, below) for column, node in enumerate(apart)})
    return places

"""Is the team one network? Laplacian, algebraic connectivity λ₂, and components of a visibility matrix (thesis §3.1).

An adjacency is a symmetric (n, n) matrix, bool or 0/1; its diagonal says nothing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planning.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


def laplacian(adjacency: ArrayLike) -> Floats:
    """The graph Laplacian L = D − A of an adjacency (n, n): (n, n) float, symmetric, rows summing to 0."""
    links = _read_adjacency(adjacency).astype(np.float64)
    return np.diag(links.sum(axis=1)) - links


def algebraic_connectivity(adjacency: ArrayLike) -> float:
    """λ₂, the second smallest eigenvalue of the Laplacian: positive exactly when the graph is connected.

    0 for fewer than two nodes, which have no second eigenvalue. O(n³).

    M. Fiedler, Algebraic connectivity of graphs, 1973, doi:10.21136/CMJ.1973.101168.
    """
    matrix = laplacian(adjacency)
    if len(matrix) < 2:
        return 0.0
    # Rounding leaves a λ₂ of 0 at either side of it.
    return max(0.0, float(np.linalg.eigvalsh(matrix)[1]))


def component_labels(adjacency: ArrayLike) -> Ints:
    """Which component each node of an adjacency (n, n) belongs to: (n,) int, numbered by their lowest node. O(n²)."""
    labels: Ints = _label_components(_read_adjacency(adjacency))
    return labels


def connected(adjacency: ArrayLike) -> bool:
    """Whether all nodes of an adjacency (n, n) are one component; so are none and one. O(n²)."""
    return bool(np.all(component_labels(adjacency) == 0))


def chain_connected(adjacency: ArrayLike, i: int, j: int) -> bool:
    """Whether a chain of links joins nodes i and j of an adjacency (n, n). O(n²)."""
    labels = component_labels(adjacency)
    return bool(labels[i] == labels[j])


def _read_adjacency(adjacency: ArrayLike) -> Bools:
    links = np.array(adjacency, dtype=np.bool_, order="C")
    if links.ndim != 2 or links.shape[0] != links.shape[1]:
        raise ValueError(f"an adjacency is a square matrix, this one has the shape {links.shape}")
    np.fill_diagonal(links, False)
    return links


@kernel
def _label_components(links: Bools) -> Ints:
    n = links.shape[0]
    labels = np.full(n, -1, np.int64)
    waiting = np.empty(n, np.int64)
    found = 0
    for root in range(n):
        if labels[root] >= 0:
            continue
        labels[root] = found
        waiting[0], count = root, 1
        while count > 0:
            count -= 1
            node = waiting[count]
            for other in range(n):
                if links[node, other] and labels[other] < 0:
                    labels[other] = found
                    waiting[count] = other
                    count += 1
        found += 1
    return labels

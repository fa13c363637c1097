"""Steiner trees: where robots have to stand so that all terminals are joined, at the least cost of links.

With the tracked agents and the base station as terminals, a Steiner tree of the mutual visibility graph is the
deployment that covers them all (thesis §3.3.3, eq. 27). The exact tree takes time exponential in the number of
terminals (:mod:`planning.dreyfus_wagner`); both approximations are polynomial and cost less than twice as much as it.
"""

from __future__ import annotations

from typing import Final, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from planning.approximate_steiner import minimum_spanning_approximation, takahashi_matsuyama
from planning.distance_network import distance_network
from planning.dreyfus_wagner import exact_tree
from planning.fixed_size_steiner import fixed_size_tree
from planning.tree import InvalidRequest, Tree, checked_terminals, checked_weights, without_repetition

Method: TypeAlias = Literal["exact", "mst", "takahashi-matsuyama"]

METHODS: Final = {
    "exact": exact_tree,
    "mst": minimum_spanning_approximation,
    "takahashi-matsuyama": takahashi_matsuyama,
}


def steiner_tree(
    W: ArrayLike,
    terminals: ArrayLike,
    method: Method = "exact",
    vertices: int | None = None,
    placements: ArrayLike | None = None,
) -> Tree:
    """A tree of direct links that joins all terminals (thesis §3.3.3, eq. 27).

    Terminals in one placement are one node of the tree, unless its size is given. With t terminals:

    - ``"exact"``: the least cost, by Dreyfus and Wagner's programme; O(3^t N + 2^t N²) at worst.
    - ``"mst"``: the minimum spanning tree of the distance network, expanded (alg. 2; L. Kou, G. Markowsky, L. Berman
      1981, doi:10.1007/BF00288961); at most 2 (1 − 1/t) times the least cost, O(t N²).
    - ``"takahashi-matsuyama"``: from one terminal, whichever is the nearest to the tree is joined next (alg. 3; H.
      Takahashi, A. Matsuyama 1980). Every terminal is tried as the first, and the cheapest tree is kept; at most
      2 (1 − 1/t) times the least cost, O(t N² + t² N).

    Args:
        W: (N, N) float, symmetric, not negative: weights of the direct links, inf where there is none, 0 on the
            diagonal.
        terminals: (t,) int, t ≥ 1: placements, which may repeat.
        method: see above.
        vertices: exactly how many nodes the tree has, each terminal and each robot one; nodes in one placement cost
            nothing between them (:mod:`planning.fixed_size_steiner`). Exact only. None: as many as are cheapest.
        placements: (N,) bool: where robots can stand. Terminals stand where they are, and links may lead on from them.
            None: everywhere.

    Raises:
        InvalidWeights: W is no such matrix.
        InvalidRequest: a terminal is no placement, there are more terminals than vertices, too many for an exact
            tree, or another argument is not as above.
        NoTree: a terminal cannot be reached, or only with more vertices.
    """
    weights = checked_weights(W)
    given = checked_terminals(terminals, len(weights))
    if method not in METHODS:
        raise InvalidRequest(f"unknown method {method!r}: use one of {', '.join(METHODS)}")
    standing = np.ones(len(weights), dtype=np.bool_)
    if placements is not None:
        standing = np.asarray(placements)
        if standing.dtype != np.bool_ or standing.shape != (len(weights),):
            raise InvalidRequest(f"placements where robots can stand are {len(weights)} times true or false")
        inside = standing.copy()
        inside[given] = True
        weights = np.where(inside[:, None] & inside, weights, np.inf)
    if vertices is None:
        return METHODS[method](weights, distance_network(weights, without_repetition(given)))
    if method != "exact":
        raise InvalidRequest(f"a tree with a given number of vertices is always exact: not {method!r}")
    if isinstance(vertices, bool) or not isinstance(vertices, int | np.integer):
        raise InvalidRequest(f"the number of vertices is a whole number, not {vertices!r}")
    return fixed_size_tree(weights, given, vertices, standing)

"""The fixed-size Steiner tree: the cheapest tree with a given number of nodes, exactly.

The thesis poses the problem (§1.2.3, §3.6) and searches one edge away from a given tree. It is solved by counting
robots instead of naming them: in the programme of :mod:`planning.subset_programme`, the terminals are nodes that can
stand in one placement each, and the robots are one kind, of which a subtree holds so many and nobody asks which.

Several nodes may stand in one placement, and links between them cost nothing. So a tree never gets dearer with more
nodes, as long as a robot may stand where another node of the tree does; and as soon as there are as many as the Steiner
tree of free size has, it costs what that one costs, for what is left over stands where another node is.
"""

from __future__ import annotations

import numpy as np

from planning.distance_network import distance_network
from planning.dreyfus_wagner import exact_tree
from planning.min_plus import scaled_links
from planning.subset_programme import ROOT, solve_subsets, states_of
from planning.tree import Bools, Floats, Ints, InvalidRequest, NoTree, Tree, without_repetition

LARGEST_TABLE = 2**26
"""Entries of a table (0.5 GB), of which there are three."""


def fixed_size_tree(W: Floats, terminals: Ints, vertices: int, standing: Bools) -> Tree:
    """A cheapest tree of exactly this number of nodes.

    Args:
        W: (N, N) float, checked.
        terminals: (t,) int, checked; those that coincide are a node each.
        vertices: number of nodes, terminals included.
        standing: (N,) bool: where robots can stand.

    Raises:
        InvalidRequest: more terminals than vertices, or too many nodes for an exact tree.
        NoTree: a terminal cannot be reached, or only with more vertices.

    Complexity: that of a tree of free size, and where it has too many nodes O(3^t r² N + 2^t r N²) time and O(2^t r N)
    memory for r = vertices − t robots.
    """
    if vertices < len(terminals):
        raise InvalidRequest(f"a tree of {vertices} nodes cannot hold {len(terminals)} terminals: ask for more")
    distinct = without_repetition(terminals)
    free = exact_tree(W, distance_network(W, distinct))
    coinciding = list(terminals)
    for v in distinct:
        coinciding.remove(v)
    shared = free.nodes[standing[free.nodes]]
    spare = vertices - len(free.nodes) - len(coinciding)
    if spare == 0 or (spare > 0 and len(shared)):
        idle = shared[:1].repeat(spare)
        doubled = np.concatenate((np.array(coinciding, dtype=np.int64), idle))
        nodes = np.concatenate((terminals, free.nodes[len(distinct) :], idle))
        return Tree(free.cost, np.concatenate((free.edges, np.column_stack((doubled, doubled)))), nodes)
    tree = _counted_tree(W, terminals, vertices - len(terminals), standing)
    if tree is None:
        links = np.where(np.isfinite(W), 1.0, np.inf)
        fewest = len(exact_tree(links, distance_network(links, distinct)).nodes) + len(coinciding)
        joined = f"the terminals in placements {terminals.tolist()}"
        if vertices < fewest:
            raise NoTree(f"{vertices} nodes do not join {joined}: it takes {fewest}")
        raise NoTree(
            f"{fewest} nodes join {joined}, and robots can stand nowhere in sight, so there cannot be {vertices}"
        )
    return tree


def _counted_tree(W: Floats, terminals: Ints, robots: int, standing: Bools) -> Tree | None:
    """The tree by the programme; None: there is none. The first terminal is the root, the robots are the last kind."""
    numbers = [1] * (len(terminals) - 1) + [robots]
    if states_of(numbers) * len(W) > LARGEST_TABLE:
        raise InvalidRequest(
            f"{len(terminals)} terminals, {robots} robots and {len(W)} placements are too many for an exact tree of "
            "fixed size: take fewer"
        )
    costs = np.full((len(terminals), len(W)), np.inf)
    costs[np.arange(len(terminals)), terminals] = 0.0
    kinds = np.concatenate((costs[1:], np.where(standing, 0.0, np.inf)[None]))
    programme = solve_subsets(scaled_links(W, 1.0), costs[0], kinds, numbers, [True] * len(kinds))
    if np.isinf(programme.cost):
        return None
    placed = programme.tree()
    cells = np.array(placed.cells)
    parents = np.array(placed.parents)
    below = parents != ROOT
    edges = np.column_stack((cells[parents[below]], cells[below]))
    nodes = np.concatenate((terminals, cells[np.array(placed.kinds) == len(kinds) - 1]))
    return Tree(programme.cost, edges, nodes)

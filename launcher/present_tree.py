"""The tree that a team is in at present, as the command line names its nodes: ``base``, ``agent``, robots by number.

Nodes are counted as in :meth:`launcher.offline_plan.Terminals.redeploy`: the base station is 0, then come the agents,
then the robots.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TypeAlias

from launcher.scenario import ScenarioFault

Links: TypeAlias = tuple[tuple[int, int], ...]


def read_links(texts: Sequence[str], agents: int, robots: int, idle: bool) -> Links:
    """The tree of ``--link A-B``, each.

    Args:
        texts: as given.
        agents: how many there are.
        robots: likewise.
        idle: robots may be left out of the tree.

    Raises:
        ScenarioFault: a name is unknown, or these links make no tree.
    """
    names = {name: node for node, name in enumerate(name_nodes(agents, robots))}
    part = list(range(len(names)))  # the least node of the part of the tree that each node is in
    links = []
    for text in texts:
        first, _, second = (word.strip() for word in text.partition("-"))
        for name in (first, second):
            if name not in names:
                raise ScenarioFault(f"--link: '{text}' is no link; write A-B with two of {', '.join(names)}")
        u, v = names[first], names[second]
        if part[u] == part[v]:
            raise ScenarioFault(f"--link {text} joins what is joined already, and a tree has no rings; leave it out")
        joined, gone = sorted((part[u], part[v]))
        part = [joined if number == gone else number for number in part]
        links.append((u, v))
    linked = {node for link in links for node in link}
    for name, node in names.items():
        if part[node] != 0 and (node <= agents or not idle or node in linked):
            raise ScenarioFault(f"no --link joins {name} to the base station; give the whole present tree")
    return tuple(links)


def read_pair(text: str, agents: int, robots: int) -> tuple[int, int]:
    """The two nodes of ``--diagram A-B``.

    Raises:
        ScenarioFault: a name is unknown, or the two are one.
    """
    names = name_nodes(agents, robots)
    first, _, second = (word.strip() for word in text.partition("-"))
    if first not in names or second not in names or first == second:
        raise ScenarioFault(f"--diagram: '{text}' is no pair; write A-B with two of {', '.join(names)}")
    return names.index(first), names.index(second)


def line_up(agents: int, robots: int) -> Links:
    """The tree that is taken for the present one where none is given.

    A line: the base station, the robots in their order, the first agent; further agents hang on the last robot.
    """
    line = [0, *range(1 + agents, 1 + agents + robots), 1]
    return (*pairwise(line), *((line[-2], agent) for agent in range(2, 1 + agents)))


def name_links(links: Links, agents: int, robots: int) -> list[str]:
    """``A-B`` of each link."""
    names = name_nodes(agents, robots)
    return [f"{names[u]}-{names[v]}" for u, v in links]


def name_nodes(agents: int, robots: int) -> list[str]:
    """``base``, ``agent`` or ``agent1`` and so on, and the numbers of robots."""
    of_agents = ["agent"] if agents == 1 else [f"agent{number}" for number in range(1, agents + 1)]
    return ["base", *of_agents, *(str(number) for number in range(1, robots + 1))]

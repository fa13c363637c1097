"""Who sees whom in a team, by true line of sight between the places that somebody has heard."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import combinations

from agents.records import Connectivity
from planning.connectivity import algebraic_connectivity, component_labels
from planning.environment import Environment
from protocol.messages import Point


def judge_network(
    environment: Environment,
    base: str,
    agent: str,
    places: Mapping[str, Point],
    edges: Sequence[tuple[str, str]],
    complete: bool,
) -> Connectivity:
    """Lines of sight between the members that are heard; whoever is not is connected to nobody.

    Args:
        environment: the map as drawn.
        base: one of the places.
        agent: may be one of them.
        places: where the members are that are heard, metres, map frame.
        edges: of the deployment tree.
        complete: whether nobody is missing.

    Complexity: O(n² w + n³) for n members and w walls.
    """
    names, points = list(places), list(places.values())
    rows = environment.visibility_matrix(points).tolist()
    component, lambda2 = _join(tuple(map(tuple, rows)))
    here, there = names.index(base), names.index(agent) if agent in places else None
    return Connectivity(
        links=tuple((points[i], points[j]) for i, j in combinations(range(len(points)), 2) if rows[i][j]),
        agent_visible=there is not None and sum(rows[there]) > 1,  # it is on the diagonal itself
        chain_connected=bool(there is not None and component[here] == component[there]),
        team_connected=complete and max(component) == 0,
        lambda2=lambda2 if complete else 0.0,
        tree_links=tuple((places[a], places[b]) for a, b in edges if a in places and b in places),
    )


@lru_cache(maxsize=64)
def _join(visible: tuple[tuple[bool, ...], ...]) -> tuple[tuple[int, ...], float]:
    """Components and λ₂ of who sees whom: the same again and again."""
    return tuple(component_labels(visible).tolist()), algebraic_connectivity(visible)

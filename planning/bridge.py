"""Intermediate deployments: the team draws together, and deploys anew from there.

Where no way from one deployment to the other is found, there often is one over a *bridge*, a deployment that both can
get to. The team draws together from its start, as far as it can towards one place, and from its goal likewise; for
moves can be taken back, the second way leads from there to the goal. The more it has drawn together on both sides, the
easier is the rest, and the longer the way: so a third is tried first, then two, then all of it.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from planning.stepwise import Steps
from planning.team_task import Level

Ints = NDArray[np.int64]

SHARES: Final = (1 / 3, 2 / 3, 1.0)
"""Of drawing together, tried one after the other."""


def cross_bridge(steps: Steps, level: Level, effort: int) -> Ints | None:
    """Deployments (n, m) int from the start to the goals; None if none are found.

    Args:
        steps: the team on its roadmap.
        level: who has to be joined; at the start and at the goals they are.
        effort: deployments to go on from, at most, in all.
    """
    each = max(1, effort // (2 + len(SHARES)))
    hub = np.full(len(steps.starts), steps.hub())
    there = steps.search(steps.starts, hub, level, each).places
    back = steps.search(steps.goals, hub, level, each).places
    for share in SHARES:
        i, j = round(share * (len(there) - 1)), round(share * (len(back) - 1))
        between = steps.search(there[i], back[j], level, each)
        if between.complete:
            return np.concatenate([there[:i], between.places, back[:j][::-1]])
    return None

"""Campaign: schedules for random redeployments, against a complete search in plain Python, and the certificate.

    python -m tests.campaigns.schedules --redeployments 40

Of every redeployment the members go along their geodesics, and the whole team is to stay one network. Up to four
members, orders over pieces of the first length are compared with those of a complete search over the same elements,
breadth first. Whole schedules are judged by the certificate. It ends with status 1 if fewer orders are found than 99 %
of those that there are, or one that is none, or if the certificate refuses a schedule or a best effort.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter

import numpy as np

from launcher.studies.motion_tasks import MotionTask, Question, draw_tasks
from launcher.studies.redeployment_runs import RADIUS_M, load_ground
from planning.certificate import certify
from planning.no_schedule import NoSchedule
from planning.order_search import search_order
from planning.pair_tables import make_tables
from planning.path_elements import cut_path
from planning.placement_graph import PlacementGraph
from planning.schedule import LONGEST_PIECE_M, MOST_STATES, schedule
from planning.step_rules import Demand
from tests.planning.order_oracle import Oracle

MAPS = ("room3", "cityblocks", "maze", "office")
MOST_COMPARED = 4
"""Members up to which the complete search ends in reasonable time."""


def geodesics_of(ground: PlacementGraph, task: MotionTask) -> list[np.ndarray]:
    """Of all members; a member that stays has a single point."""
    return [
        ground.geodesics.path(a, b) if np.any(a != b) else a[None] for a, b in zip(task.starts, task.goals, strict=True)
    ]


def compare(ground: PlacementGraph, paths: list[np.ndarray], radii: np.ndarray) -> tuple[bool, bool]:
    """Whether an order is found, and whether there is one."""
    elements = [cut_path(path, LONGEST_PIECE_M) for path in paths]
    separations = np.where(np.minimum(radii[:, None], radii) > 0.0, radii[:, None] + radii, 0.0)
    environment = ground.environment
    tables = make_tables(elements, separations, [], environment.walls, environment.tolerance_m)
    last = np.array([path.pieces for path in elements], dtype=np.int64)
    demand = Demand((1 << len(paths)) - 1, np.zeros(len(paths), dtype=np.int64))
    seconds = (np.arange(max(1, last.max())) < last[:, None]).astype(np.float64)
    order = search_order(tables, demand, seconds, last, MOST_STATES)
    oracle = Oracle(tables, demand, last)
    return order.complete, oracle.search()


def main() -> int:
    """Print what was found for each map and number of members; 1 where less is found than there is."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--redeployments", type=int, default=40, help="of each map and number of members")
    parser.add_argument("--members", type=int, nargs="+", default=[4, 6, 8], help="base and agent among them")
    parser.add_argument("--cells", action="store_true", help="deploy on inflection cells, not on points")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    compared: Counter[tuple[bool, bool]] = Counter()
    refused = 0
    columns = ("members", "found", "proven none", "given up", "median ms", "p99 ms", "late")
    print(f"{'map':<12}" + "".join(f"{column:>13}" for column in columns))
    for name in MAPS:
        ground = load_ground(name, "inflection" if options.cells else None)
        for members in options.members:
            radii = np.append(0.0, np.full(members - 1, RADIUS_M))
            outcomes: Counter[str] = Counter()
            spent, late = [], []
            for task in draw_tasks(ground, Question(members), options.redeployments, options.seed):
                paths = geodesics_of(ground, task)
                began = time.process_time()
                try:
                    plan = schedule(paths, radii, ground.environment)
                    outcomes["found"] += 1
                except NoSchedule as refusal:
                    plan = refusal.best
                    outcomes["proven none" if refusal.proven else "given up"] += 1
                else:
                    alone = max(float(np.hypot(*np.diff(path, axis=0).T).sum()) for path in paths)
                    late += [plan.end_s / alone - 1.0] if alone > 0.0 else []
                spent.append(1e3 * (time.process_time() - began))
                certificate = certify(plan, ground.environment)
                if not certificate.valid:
                    refused += 1
                    print(f"refused: {name}, {members} members: {certificate.violations[0].text}")
                if members <= MOST_COMPARED:
                    compared[compare(ground, paths, radii)] += 1
            counts = (members, *(outcomes[column] for column in columns[1:4]))
            print(
                f"{name:<12}" + "".join(f"{count:>13}" for count in counts),
                f"{np.median(spent):>12.1f}{np.quantile(spent[1:], 0.99):>13.1f}{np.mean(late or [np.nan]):>13.1%}",
                flush=True,
            )
    there_are = compared[True, True] + compared[False, True]
    share = compared[True, True] / max(1, there_are)
    print(
        f"orders of up to {MOST_COMPARED} members: {compared[True, True]} found of {there_are} that there are "
        f"({share:.1%}), {compared[True, False]} found where there is none, {compared[False, False]} rightly not found"
    )
    print(f"the certificate refuses {refused}")
    return 1 if share < 0.99 or compared[True, False] or refused else 0


if __name__ == "__main__":
    sys.exit(main())

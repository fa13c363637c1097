"""Random schedules in stages, mutants of them, and two judges: what the certificate by progress is held against.

The one judge knows the rule: in every two stages that follow each other, discs keep apart and links hold from all
places of one way to all of another. It asks shapely for distances and hulls, and networkx for the network. The other
knows only what happens: it lets members go by turns as the rule of progress allows, and looks at every millimetre. Both
forgive what is within a few tolerances of the limit, as the certificate does.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import networkx as nx
import numpy as np
import shapely
from numpy.typing import NDArray

from planning.certificate import certify
from planning.continuation import assemble
from planning.motion_plan import Schedule, TimedPath
from tests.planning.schedule_mutants import (
    FORGIVEN,
    SPEED,
    Ground,
    broken_between,
    hits_wall,
    random_team,
    sample_times,
    too_fast,
)

Floats = NDArray[np.float64]
Legs = list[list[Floats]]
"""For each member its way in each stage, (m, 2) float, metres; of an unscheduled one all of it in the first."""

DIP = 20.0
"""Tolerances: the most that sharp corners recede for the certificate. Schedules here are at its limit, not near it."""

KINDS = ("sooner", "swap", "merge", "drop", "exchange", "border", "waypoint", "hair", "clock", "unscheduled")


def random_staged(ground: Ground, robots: int, rng: np.random.Generator) -> Schedule | None:
    """A random team that goes to random places near by, as far as the certificate lets it; None where nobody moves.

    Where it stops somebody, the schedule is at the limit of a rule.
    """
    team = random_team(ground, robots, rng)
    if team is None:
        return None
    members, places = team
    radii = np.array([0.0] + [ground.radius_m] * robots)
    made = Schedule(members, [TimedPath.standing(place) for place in places], radii, SPEED, [[0, 0]] * len(members))
    for _ in range(3 * robots):
        i = int(rng.integers(1, len(members)))
        place = read_legs(made)[i][-1][-1]
        goal = place + rng.normal(0.0, 4.0, 2)
        if ground.free.contains(goal)[0]:
            made = _append(ground, made, i, ground.geodesics.path(place, goal), rng)
    return made if any(len(path.times_s) > 1 for path in made.paths) else None


def _cut(way: Floats, shares: Floats) -> list[Floats]:
    """A way in pieces, cut at shares of its length."""
    covered = np.append(0.0, np.cumsum(np.hypot(*np.diff(way, axis=0).T)))
    pieces = []
    for share in shares[::-1]:
        at = share * covered[-1]
        before = int(np.searchsorted(covered, at))
        place = np.array([[np.interp(at, covered, way[:, axis]) for axis in (0, 1)]])
        pieces.append(np.concatenate([place, way[before:]]))
        way, covered = np.concatenate([way[:before], place]), np.append(covered[:before], at)
    return [way, *pieces[::-1]]


def _append(ground: Ground, schedule: Schedule, i: int, way: Floats, rng: np.random.Generator) -> Schedule:
    """The schedule with more to go for one member, in one to three stages.

    It goes the whole way as soon as it may, or from some stage on as much of it as it may.
    """
    legs = read_legs(schedule)
    first = max((n + 1 for n, leg in enumerate(legs[i]) if len(leg) > 1), default=0)
    shares = np.sort(rng.uniform(0.0, 1.0, rng.integers(3)))
    starts = range(first, len(legs[i]) + 2)
    for start in starts:
        longer = _lengthen(schedule, i, start, _cut(way, shares))
        if certify(longer, ground.environment).valid:
            return longer
    start = int(rng.choice(starts))
    longest, low, high = schedule, 0.0, 1.0
    while high - low > 1e-7:
        share = 0.5 * (low + high)
        longer = _lengthen(schedule, i, start, _cut(_cut(way, np.array([share]))[0], shares))
        if certify(longer, ground.environment).valid:
            longest, low = longer, share
        else:
            high = share
    # Nobody goes where there is nothing to go: that could be done within the tolerances at any time.
    return longest if low * float(np.hypot(*np.diff(way, axis=0).T).sum()) > 1e-3 else schedule


def _lengthen(schedule: Schedule, i: int, start: int, pieces: list[Floats]) -> Schedule:
    """The schedule with pieces of way for one member from a stage on in which it only stands."""
    legs = [list(own) for own in read_legs(schedule)]
    for own in legs:
        own += [own[-1][-1:]] * (start + len(pieces) - len(own))
    legs[i][start:] = [*pieces, *[pieces[-1][-1:]] * (len(legs[i]) - start - len(pieces))]
    return _assemble(schedule, legs, frozenset())


def read_legs(schedule: Schedule) -> Legs:
    """The ways of all members in all stages, without stops."""
    legs = []
    for i, name in enumerate(schedule.members):
        if name in schedule.unscheduled:
            own = [schedule.piece(i, 0, 0)] + [schedule.piece(i, 0, 0)[-1:]] * (schedule.stage_count - 1)
        else:
            own = [schedule.piece(i, n, n) for n in range(schedule.stage_count)]
        legs.append([leg[np.append(True, np.any(np.diff(leg, axis=0) != 0.0, axis=1))] for leg in own])
    return legs


def _assemble(schedule: Schedule, legs: Legs, unscheduled: frozenset[str]) -> Schedule:
    """The same team on other ways, at full speed; those who are unscheduled last."""
    order = sorted(range(len(schedule)), key=lambda i: schedule.members[i] in unscheduled)
    waiting = [i for i in order if schedule.members[i] not in unscheduled]
    others = {}
    for i in order[len(waiting) :]:
        way = np.concatenate([legs[i][0][:1], *(leg[1:] for leg in legs[i])])
        steps = np.hypot(*np.diff(way, axis=0).T) / schedule.speeds_m_s[i]
        others[schedule.members[i]] = TimedPath(way, np.append(0.0, np.cumsum(steps)))
    names = [schedule.members[i] for i in waiting]
    ways = [legs[i] for i in waiting]
    return assemble(names, ways, schedule.radii_m[order], schedule.speeds_m_s[order], unscheduled=others)


def staged_mutants(schedule: Schedule, rng: np.random.Generator, count: int) -> Iterator[tuple[str, Schedule]]:
    """Each with one thing changed in who goes where in which stage, or when on the nominal clock."""
    made = 0
    while made < count:
        kind = str(rng.choice(KINDS))
        if kind == "clock":
            mutant = _change_clock(schedule, rng)
        elif kind == "unscheduled":
            free = schedule.unscheduled | {str(rng.choice(schedule.members[1:]))}
            mutant = _assemble(schedule, read_legs(schedule), free) if len(free) < len(schedule) else None
        else:
            legs = read_legs(schedule)
            mutant = _assemble(schedule, legs, schedule.unscheduled) if _change(kind, schedule, legs, rng) else None
        if mutant is not None:
            made += 1
            yield kind, mutant


def _change_clock(schedule: Schedule, rng: np.random.Generator) -> Schedule | None:
    """Someone sets off late, or does not wait as long as it should: the ways stay as they are."""
    i = int(rng.integers(len(schedule)))
    path = schedule.paths[i]
    if len(path.times_s) == 1:
        return None
    w = int(rng.integers(len(path.times_s)))
    times = path.times_s.copy()
    stops = np.flatnonzero(np.all(np.diff(path.waypoints, axis=0) == 0.0, axis=1))
    if len(stops) and rng.uniform() < 0.5:
        w = int(rng.choice(stops)) + 1
        times[w:] -= rng.uniform(0.0, 1.0) * (times[w] - times[w - 1])
    else:
        times[w:] += rng.uniform(0.0, 3.0)
    paths = list(schedule.paths)
    paths[i] = TimedPath(path.waypoints, times)
    return Schedule(
        schedule.members, paths, schedule.radii_m, schedule.speeds_m_s, schedule.stages, schedule.unscheduled
    )


def _change(kind: str, schedule: Schedule, legs: Legs, rng: np.random.Generator) -> bool:
    """Change one thing in place; False if this one cannot be changed so."""
    stages = len(legs[0])
    moving = [(i, n) for i, own in enumerate(legs) for n, leg in enumerate(own) if len(leg) > 1]
    i, n = moving[rng.integers(len(moving))]
    own = legs[i]
    if kind == "sooner":
        other = n + int(rng.choice([-1, 1]))
        return 0 <= other < stages and len(own[other]) == 1 and _swap(own, min(n, other))
    if kind == "exchange":
        j = int(rng.integers(len(legs)))
        return j != i and _exchange(own, legs[j])
    if kind in {"waypoint", "hair"}:
        spread = 1.0 if kind == "waypoint" else 10 ** rng.uniform(-6, -1)
        w = int(rng.integers(1, len(own[n])))
        own[n] = own[n].copy()
        own[n][w] += rng.normal(0.0, spread, 2)
        for m in range(n + 1, stages):
            own[m] = np.concatenate([own[m - 1][-1:], own[m][1:]])
        return True
    if kind == "drop":
        empty = [m for m in range(stages) if all(len(own[m]) == 1 for own in legs)]
        if not empty or stages == 1:
            return False
        gone = int(rng.choice(empty))
        for own in legs:
            del own[gone]
        return True
    if n + 1 == stages:
        return False
    if kind == "swap":
        swapped = [_swap(own, n) for own in legs]
        return any(swapped)
    if kind == "merge":
        for own in legs:
            own[n : n + 2] = [np.concatenate([own[n], own[n + 1][1:]])]
        return True
    own[n : n + 2] = _cut(np.concatenate([own[n], own[n + 1][1:]]), rng.uniform(0.0, 1.0, 1))
    return True


def _swap(own: list[Floats], n: int) -> bool:
    """Go in stage n + 1 what was to go in n, or the other way round; False if there is something to go in both."""
    if len(own[n]) > 1 and len(own[n + 1]) > 1:
        return False
    own[n], own[n + 1] = (own[n][:1], own[n]) if len(own[n]) > 1 else (own[n + 1], own[n + 1][-1:])
    return True


def _exchange(own: list[Floats], other: list[Floats]) -> bool:
    """Each goes in the stages in which the other went; all that is left in the last of these."""
    moves = [[n for n, leg in enumerate(legs) if len(leg) > 1] for legs in (own, other)]
    if not moves[0] or not moves[1] or moves[0] == moves[1]:
        return False
    for legs, mine, new in ((own, moves[0], moves[1]), (other, moves[1], moves[0])):
        ways = [legs[n] for n in mine]
        if len(ways) > len(new):
            rest = ways[len(new) - 1 :]
            ways[len(new) - 1 :] = [np.concatenate([rest[0], *(way[1:] for way in rest[1:])])]
        place = legs[0][:1]
        taken = dict(zip(new, ways, strict=False))
        for n in range(len(legs)):
            legs[n] = taken.get(n, place)
            place = legs[n][-1:]
    return True


def breaks_the_rule(ground: Ground, schedule: Schedule) -> set[str]:
    """Which kinds of violation there are by the rule as it stands."""
    environment = ground.environment
    slack = FORGIVEN * environment.tolerance_m
    broken = {
        "wall"
        for path, radius in zip(schedule.paths, schedule.radii_m, strict=True)
        if hits_wall(ground, path.waypoints, float(radius))
    }
    if too_fast(ground, schedule):
        broken.add("speed")
    if _hurries(schedule, slack):
        broken.add("progress")
    # As deep at corners as the certificate's walls recede.
    space = environment.polygon.buffer(0.5 * slack, join_style="mitre", mitre_limit=DIP)
    shapely.prepare(space)
    for n in range(max(1, schedule.stage_count - 1)):
        ways = [schedule.piece(i, n, min(n + 1, schedule.stage_count - 1)) for i in range(len(schedule))]
        network = nx.empty_graph(len(ways))
        for i, j in combinations(range(len(ways)), 2):
            one, other = (shapely.LineString(way[[0, *range(len(way))]]) for way in (ways[i], ways[j]))
            near = schedule.radii_m[i] + schedule.radii_m[j] - slack
            if min(schedule.radii_m[[i, j]]) > 0.0 and shapely.distance(one, other) < near:
                broken.add("collision")
            if not nx.has_path(network, i, j) and _sees_throughout(space, ways[i], ways[j]):
                network.add_edge(i, j)
        if not nx.is_connected(network):
            broken.add("connection")
    return broken


def _sees_throughout(space: shapely.Polygon, one: Floats, other: Floats) -> bool:
    pieces = [np.stack([way[:-1], way[1:]], axis=1) if len(way) > 1 else way[None] for way in (one, other)]
    corners = [np.concatenate([p, q]) for p in pieces[0] for q in pieces[1]]
    return bool(shapely.covers(space, [shapely.MultiPoint(four).convex_hull for four in corners]).all())


def _hurries(schedule: Schedule, slack: float) -> bool:
    """Whether anyone is farther on its way, at any instant of the clock, than the rule of progress lets it be."""
    assert schedule.stages is not None
    rows = [i for i, name in enumerate(schedule.members) if name not in schedule.unscheduled]
    paths = [schedule.paths[i] for i in rows]
    times = np.unique(np.concatenate([path.times_s for path in paths]))
    times = np.union1d(times, 0.5 * (times[1:] + times[:-1]))
    covered = [np.append(0.0, np.cumsum(np.hypot(*np.diff(path.waypoints, axis=0).T))) for path in paths]
    gone = np.array([np.interp(times, path.times_s, way) for path, way in zip(paths, covered, strict=True)])
    ends = np.array([way[schedule.stages[i, 1:]] for i, way in zip(rows, covered, strict=True)])
    # How many stages all have finished, and so how far each may be.
    level = np.min(
        [np.searchsorted(end, along + slack, side="right") for end, along in zip(ends, gone, strict=True)], axis=0
    )
    most = ends[:, np.minimum(level + 1, schedule.stage_count - 1)]
    return bool(np.any(gone > most + slack))


def breaks_by_turns(ground: Ground, schedule: Schedule, rng: np.random.Generator) -> set[str]:
    """What is seen at every millimetre while members go by turns, at random, as the rule of progress allows."""
    by_turns = _go_by_turns(schedule, rng)
    places = by_turns.positions(sample_times(by_turns, 1e-3 / SPEED))
    return broken_between(ground, schedule.radii_m, places, DIP)


def _go_by_turns(schedule: Schedule, rng: np.random.Generator) -> Schedule:
    """One goes while all others stand: a piece of its way in its stage, then another one of its own."""
    legs = read_legs(schedule)
    free = [name in schedule.unscheduled for name in schedule.members]
    lines = [[shapely.LineString(leg[[0, *range(len(leg))]]) for leg in own] for own in legs]
    stage, gone = [0] * len(legs), [0.0] * len(legs)
    tracks = [([own[0][0]], [0.0]) for own in legs]
    clock = 0.0
    last = schedule.stage_count - 1
    while True:
        slowest = min([n for n, waits_not in zip(stage, free, strict=True) if not waits_not], default=last)
        able = [i for i, n in enumerate(stage) if n <= last and (free[i] or n <= slowest + 1)]
        if not able:
            break
        i = int(rng.choice(able))
        line = lines[i][stage[i]]
        until = line.length if rng.uniform() < 0.6 else rng.uniform(gone[i], line.length)
        points, times = tracks[i]
        if until > gone[i]:
            if clock > times[-1]:
                points.append(points[-1])
                times.append(clock)
            covered = np.cumsum(np.hypot(*np.diff(legs[i][stage[i]], axis=0).T))
            passed = [float(at) for at in covered if gone[i] < at < until]
            for at in (*passed, until):
                clock += (at - gone[i]) / SPEED
                gone[i] = at
                if clock > times[-1]:
                    points.append(shapely.get_coordinates(line.interpolate(at))[0])
                    times.append(clock)
        if until == line.length:
            stage[i], gone[i] = stage[i] + 1, 0.0
    return Schedule(schedule.members, [TimedPath(*track) for track in tracks], schedule.radii_m)

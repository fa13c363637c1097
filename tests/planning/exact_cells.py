"""Counts of a decomposition by exact rational arithmetic and Euler's formula: slow, without a tolerance or a face.

Nothing here looks at walls next to a vertex: where a line may go is decided by whether the middles of its pieces lie
strictly inside the free space.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations, pairwise

from planning.environment import Environment

Point = tuple[Fraction, Fraction]
Segment = tuple[Point, Point]


def count_exactly(environment: Environment, kind: str) -> dict[str, int]:
    """Lr, La, I and N of an environment whose coordinates are exact."""
    rings = [[(Fraction(x), Fraction(y)) for x, y in ring] for ring in environment.rings]
    walls = [(ring[k - 1], ring[k]) for ring in rings for k in range(len(ring))]
    corners = [(ring[k - 1], ring[k], ring[(k + 1) % len(ring)]) for ring in rings for k in range(len(ring))]
    reflex = [corner for corner in corners if cross(subtract(corner[1], corner[0]), subtract(corner[2], corner[1])) < 0]
    rays = {
        frozenset((here, run(walls, here, subtract(here, there))))
        for before, here, after in reflex
        for there in (before, after)
    }
    bitangents = []
    if kind == "aspect":
        for (_, u, _), (_, v, _) in combinations(reflex, 2):
            ends = find_bitangent(walls, u, v)
            if ends is not None:
                bitangents.append(ends)
    segments = [*walls, *((p, q) for p, q in map(tuple, rays)), *bitangents]
    points, edges = arrange_exactly(segments)
    return {
        "Lr": len(rays),
        "La": 3 * len(bitangents),
        "I": len(points),
        "N": len(edges) - len(points) + 1 - len(environment.holes),
    }


def find_bitangent(walls: list[Segment], u: Point, v: Point) -> Segment | None:
    """Ends of the line through u and v if it is a bitangent that touches nothing between them and ends across walls."""
    along = subtract(v, u)
    if any(0 < t < 1 for t in find_hits(walls, u, along)) or not is_strictly_inside(
        walls, at(u, along, Fraction(1, 2))
    ):
        return None
    back, ahead = run(walls, u, subtract(u, v)), run(walls, v, along)
    if back == u or ahead == v:
        return None
    for end in (back, ahead):
        if any(end in wall and cross(subtract(wall[1], wall[0]), along) == 0 for wall in walls):
            return None
    return back, ahead


def run(walls: list[Segment], start: Point, along: Point) -> Point:
    """Where the ray stops: before its first piece that is not strictly inside the free space."""
    reached = Fraction(0)
    for t in sorted({t for t in find_hits(walls, start, along) if t > 0}):
        if not is_strictly_inside(walls, at(start, along, (reached + t) / 2)):
            break
        reached = t
    return at(start, along, reached)


def find_hits(walls: list[Segment], start: Point, along: Point) -> list[Fraction]:
    """Parameters at which a line meets walls; of a wall along the line, both ends."""
    hits = []
    for a, b in walls:
        wall, offset = subtract(b, a), subtract(a, start)
        sine = cross(along, wall)
        if sine != 0:
            if 0 <= cross(offset, along) / sine <= 1:
                hits.append(cross(offset, wall) / sine)
        elif cross(offset, along) == 0:
            hits += [parameter(start, along, a), parameter(start, along, b)]
    return hits


def is_strictly_inside(walls: list[Segment], point: Point) -> bool:
    """Whether a point is inside by the crossing rule, and on no wall."""
    x, y = point
    inside = False
    for a, b in walls:
        side = cross(subtract(b, a), subtract(point, a))
        if side == 0 and min(a[0], b[0]) <= x <= max(a[0], b[0]) and min(a[1], b[1]) <= y <= max(a[1], b[1]):
            return False
        if (a[1] > y) != (b[1] > y) and (side > 0) == (b[1] > a[1]):
            inside = not inside
    return inside


def arrange_exactly(segments: list[Segment]) -> tuple[set[Point], set[frozenset[Point]]]:
    """Vertices and edges of the arrangement of segments."""
    on_segment: list[set[Point]] = [{p, q} for p, q in segments]
    for (i, (a, b)), (j, (c, d)) in combinations(enumerate(segments), 2):
        u, v, offset = subtract(b, a), subtract(d, c), subtract(c, a)
        sine = cross(u, v)
        if sine != 0:
            s, t = cross(offset, v) / sine, cross(offset, u) / sine
            if 0 <= s <= 1 and 0 <= t <= 1:
                on_segment[i].add(at(a, u, s))
                on_segment[j].add(at(a, u, s))
        elif cross(offset, u) == 0:
            on_segment[i].update(p for p in (c, d) if 0 <= parameter(a, u, p) <= 1)
            on_segment[j].update(p for p in (a, b) if 0 <= parameter(c, v, p) <= 1)
    edges = set()
    for points in on_segment:
        ordered = sorted(points)
        edges.update(frozenset(pair) for pair in pairwise(ordered))
    return set().union(*on_segment), edges


def subtract(p: Point, q: Point) -> Point:
    return p[0] - q[0], p[1] - q[1]


def cross(u: Point, v: Point) -> Fraction:
    return u[0] * v[1] - u[1] * v[0]


def at(start: Point, along: Point, t: Fraction) -> Point:
    return start[0] + t * along[0], start[1] + t * along[1]


def parameter(start: Point, along: Point, point: Point) -> Fraction:
    """Where on the line a point of the line lies."""
    offset = subtract(point, start)
    return offset[0] / along[0] if along[0] != 0 else offset[1] / along[1]

"""The shared estimate: laws of merging, replay, folding; and peers on a network that loses, doubles and delays."""

from __future__ import annotations

import itertools
from collections import defaultdict
from copy import deepcopy

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.ellipsoid import EmptyIntersection
from estimation.range_filter import RangeFilter
from estimation.range_log import BadRecord, Heard, RangeLog, TimedRange
from estimation.shared_ranges import Digest, SharedRanges
from estimation.shared_snapshot import NotASnapshot, TimedSnapshot, fuse_snapshots, predict_snapshot
from estimation.tight_set import TightSet

PEERS = ("ann", "bob", "cid", "dee")
records = st.builds(
    lambda peer, number, anchor, z: TimedRange(peer, number, number * 0.7 + PEERS.index(peer) * 0.1, anchor, z, 0.5),
    st.sampled_from(PEERS),
    st.integers(0, 12),
    st.just((0.0, 0.0)),
    st.just(5.0),
)
logs = st.lists(records, max_size=20).map(RangeLog)


def merged(*parts):
    whole = RangeLog()
    for part in parts:
        whole.merge(part)
    return whole


@settings(max_examples=150, deadline=None)
@given(logs, logs, logs)
def test_merging_logs_is_commutative_associative_and_idempotent(a, b, c):
    assert merged(a, b) == merged(b, a)
    assert merged(merged(a, b), c) == merged(a, merged(b, c))
    assert merged(a, a) == a
    assert merged(a, RangeLog()) == a


@settings(max_examples=100, deadline=None)
@given(logs, logs)
def test_a_delta_brings_what_is_missing_and_no_more(a, b):
    delta = a.missing_in(b.heard)
    assert not any(b.has(record) for record in delta)
    for record in delta:
        b.add(record)
    assert not a.missing_in(b.heard)
    assert [record for record in b if a.has(record)] == list(a)


@settings(max_examples=100, deadline=None)
@given(st.lists(st.integers(0, 30)), st.lists(st.integers(0, 30)))
def test_heard_is_a_set_of_numbers(first, second):
    def heard(numbers):
        value = Heard()
        for number in numbers:
            value = value.and_number(number)
        return value

    both = heard(first).merged(heard(second))
    assert {number for number in range(40) if number in both} == {*first, *second}
    assert both == heard([*second, *first])
    assert all(number > both.below for number in both.beyond)


def test_records_that_cannot_be_are_refused():
    with pytest.raises(BadRecord, match="finite"):
        TimedRange("ann", 0, float("nan"), (0, 0), 5, 0.5)
    with pytest.raises(BadRecord, match="at least 0"):
        TimedRange("ann", -1, 0, (0, 0), 5, 0.5)
    with pytest.raises(BadRecord, match="roster"):
        SharedRanges("eve", PEERS, RangeFilter)
    shared = SharedRanges("ann", PEERS, RangeFilter)
    shared.digest(10.0)
    with pytest.raises(BadRecord, match="earlier"):
        shared.record(9.0, (0, 0), 5, 0.5)
    assert shared.record(10.0, (0, 0), 5, 0.5).number == 0


def numbers_of(state):
    """All that there is to a set, to compare exactly."""
    if isinstance(state, RangeFilter):
        return state.snapshot()
    return tuple(tuple(map(tuple, polygon)) for polygon in state.polygons)


class World:
    """Four robots on their paths and a target that may walk; ranges with true bounds."""

    def __init__(self, seed, speed=0.0, clock_bound=0.0, corrupt=0.0):
        self.rng = np.random.default_rng(seed)
        self.speed, self.corrupt = speed, corrupt
        self.clocks = dict(zip(PEERS, self.rng.uniform(0, clock_bound, len(PEERS)), strict=True))
        self.target = self.rng.uniform(-10, 10, 2)
        self.places = {peer: self.rng.uniform(-15, 15, 2) for peer in PEERS}
        self.heading = self.rng.uniform(0, 6)

    def step(self, seconds):
        self.heading += self.rng.normal(0, 0.5)
        self.target = self.target + self.speed * seconds * np.array([np.cos(self.heading), np.sin(self.heading)])
        for peer in PEERS:
            self.places[peer] = self.places[peer] + self.rng.uniform(-1, 1, 2) * seconds

    def range_from(self, peer, bound):
        z = np.hypot(*(self.target - self.places[peer])) + bound * self.rng.choice([-1, 1])
        if self.rng.random() < self.corrupt:
            z += self.rng.uniform(3, 9)
        return max(0.0, float(z))


def gossip(seed, begin, *, speed=0.0, clock_bound=0.0, corrupt=0.0, seconds=12.0, quiet=4.0, horizon=60.0, fold=True):
    """30 % loss, 20 % duplicates, delays up to 0.6 s that reorder. Yields (time, world, peers) after each step."""
    world = World(seed, speed, clock_bound, corrupt)
    limits = {"speed_m_s": speed, "clock_bound_s": clock_bound, "horizon_s": horizon}
    peers = {peer: SharedRanges(peer, PEERS, begin, **limits) for peer in PEERS}
    on_the_way = defaultdict(list)
    order = itertools.count()

    def send(now, receiver, kind, body):
        for _ in range(1 + (world.rng.random() < 0.2)):
            if world.rng.random() >= 0.3:
                on_the_way[receiver].append((now + world.rng.uniform(0.01, 0.6), next(order), kind, body))

    now, steps = 0.0, round((seconds + quiet) / 0.1)
    for number in range(steps):
        now = 0.1 * number
        world.step(0.1 if now < seconds else 0.0)
        for name, peer in peers.items():
            clock = now + world.clocks[name]
            due = sorted(item for item in on_the_way[name] if item[0] <= now)
            on_the_way[name] = [item for item in on_the_way[name] if item[0] > now]
            for _, _, kind, body in due:
                if kind == "ranges":
                    peer.receive(body)
                else:
                    peer.note(body)
                    send(now, body.peer, "ranges", peer.delta(body))
            if now < seconds and number % 5 == PEERS.index(name):
                made = peer.record(clock, tuple(world.places[name]), world.range_from(name, 0.4), 0.4)
                for other in PEERS:
                    if other != name:
                        send(now, other, "ranges", [made])
            if number % 4 == PEERS.index(name):
                digest = peer.digest(clock)
                for other in PEERS:
                    if other != name:
                        send(now, other, "digest", digest)
                if fold:
                    peer.fold(clock)
        yield now, world, peers


def after(gossiping):
    """World and peers at the end."""
    *_, (_, world, peers) = gossiping
    return world, peers


def holds(peer, clock_s, point):
    state = peer.state_at(clock_s)
    if not state.started:
        return True
    return bool((state.feasible_set() if isinstance(state, RangeFilter) else state).contains(point))


@pytest.mark.parametrize("begin", [RangeFilter, TightSet])
@pytest.mark.parametrize("speed, clock_bound", [(0.0, 0.0), (0.8, 0.0), (0.8, 0.15)])
def test_every_peer_contains_the_target_whatever_the_network_does(begin, speed, clock_bound):
    for seed in range(3):
        for now, world, peers in gossip(seed, begin, speed=speed, clock_bound=clock_bound, seconds=8, quiet=3):
            if round(10 * now) % 7 == 0 and now < 8:
                for name, peer in peers.items():
                    clock = now + world.clocks[name]
                    assert holds(peer, clock, world.target), f"seed {seed}, {name} at {now:.1f} s"
        states = [peer.state_at(now + 1.0) for peer in peers.values()]
        assert len({numbers_of(state) for state in states}) == 1, f"seed {seed}"


@pytest.mark.parametrize("speed, clock_bound, fold", [(0.0, 0.0, False), (0.5, 0.0, True), (0.5, 0.1, True)])
def test_after_quiet_peers_agree_and_are_as_tight_as_one_that_hears_all(speed, clock_bound, fold):
    """Also folded: with the area of a central set that hears all at once, and stands by the same clock bound."""
    for seed in range(3):
        together = {}
        gossiping = gossip(seed, TightSet, speed=speed, clock_bound=clock_bound, seconds=8, quiet=4, fold=fold)
        for now, world, peers in gossiping:  # noqa: B007
            together |= {record.key: record for peer in peers.values() for record in peer.log}
        assert len(together) == 4 * 16
        central, before, widening = TightSet(), None, speed * clock_bound
        for (time, *_), record in sorted(together.items()):
            central.predict(0.0 if before is None else speed * (time - before))
            central.measure(record.anchor, record.range_m, record.bound_m + widening)
            before = time
        central.predict(speed * (now - before))
        for peer in peers.values():
            assert (peer.folded > 40) == fold and peer.late == 0, f"seed {seed}"
            assert peer.state_at(now).area_m2 <= 1.2 * central.area_m2, f"seed {seed}"
        assert len({peer.log.heard["ann"] for peer in peers.values()}) == 1
        assert central.contains(world.target)


@pytest.mark.parametrize("begin", [RangeFilter, TightSet])
def test_equal_logs_give_equal_sets_rejections_included(begin):
    """Corrupt ranges, whatever they lead to, lead to the same in every peer, in whatever order ranges came."""
    world = World(3, corrupt=0.15)
    made = []
    for number in range(60):
        peer = PEERS[number % 4]
        world.step(0.25)
        z = world.range_from(peer, 0.4)
        made.append(TimedRange(peer, number // 4, 0.25 * number, tuple(world.places[peer]), z, 0.4))
    results = set()
    for seed in range(4):
        shared = SharedRanges("ann", PEERS, begin, speed_m_s=0.2)
        order = np.random.default_rng(seed).permutation(60)
        for index in [*order, *order[:20]]:
            shared.receive([made[index]])
            if index % 9 == 0:
                shared.state_at(20.0)
        results.add(numbers_of(shared.state_at(20.0)))
    plain = begin()
    for before, record in zip([None, *made], made, strict=False):
        if before is not None:
            plain.predict(0.2 * (record.time_s - before.time_s))
        plain.measure(record.anchor, record.range_m, record.bound_m)
    plain.predict(0.2 * (20.0 - made[-1].time_s))
    assert results == {numbers_of(plain)}


def test_folding_changes_nothing_but_memory():
    _, folding = after(gossip(1, RangeFilter, speed=0.5))
    _, keeping = after(gossip(1, RangeFilter, speed=0.5, fold=False))
    for name in PEERS:
        assert numbers_of(folding[name].state_at(20)) == numbers_of(keeping[name].state_at(20))
        assert folding[name].late == 0
        assert len(folding[name].log) < 0.3 * len(keeping[name].log)
        assert folding[name].folded + len(folding[name].log) == len(keeping[name].log)


def test_a_dead_peer_does_not_fill_the_memory_and_late_ranges_are_dropped_and_counted():
    shared = SharedRanges("ann", PEERS, RangeFilter, horizon_s=5)
    straggler = TimedRange("bob", 0, 1.0, (9.0, 0.0), 9.0, 0.5)
    next_one = TimedRange("bob", 1, 28.0, (9.0, 1.0), 9.0, 0.5)
    for number in range(300):
        shared.record(0.1 * number, (0.1 * number, 0.0), float(np.hypot(3, 4 - 0.1 * number)), 0.6)
        shared.fold(0.1 * number)
    assert len(shared.log) <= 52
    before = shared.state_at(30)
    assert shared.receive([straggler, straggler]) == 0
    assert shared.late == 1
    assert numbers_of(shared.state_at(30)) == numbers_of(before)
    assert shared.receive([next_one]) == 1
    # What came too late is not asked for again.
    assert shared.digest(30).heard["bob"] == Heard(2)


def test_a_clock_that_is_years_ahead_does_not_silence_the_others():
    shared = SharedRanges("ann", PEERS, RangeFilter, speed_m_s=1.0, clock_bound_s=0.2, horizon_s=5)
    ahead = TimedRange("bob", 0, 1e8, (9.0, 0.0), 9.0, 0.5)
    right = TimedRange("cid", 0, 10.15, (9.0, 0.0), 9.0, 0.5)
    assert shared.receive([ahead, right], now_s=10.0) == 1
    assert shared.fold(20.0) == 1
    shared.record(20.0, (0.0, 3.0), 4.0, 0.5)
    assert shared.late == 0 and shared.log.heard["ann"] == Heard(1)
    assert "bob" not in shared.log.heard


def test_strangers_leave_nothing_behind():
    shared = SharedRanges("ann", PEERS, RangeFilter)
    for start in range(50):
        shared.note(Digest(f"eve-{start}", 1.0, {"eve": Heard(3)}))
    assert not shared._digests


def test_gaps_are_given_up_with_the_horizon():
    shared = SharedRanges("ann", ("ann", "bob"), RangeFilter, horizon_s=5)
    shared.receive([TimedRange("bob", number, 0.1 * number, (0, 0), 5, 0.5) for number in range(0, 100, 3)])
    assert len(shared.digest(0).heard["bob"].beyond) > 30
    shared.fold(60)
    assert shared.digest(60).heard["bob"] == Heard(100)


@pytest.mark.parametrize("begin", [RangeFilter, TightSet])
def test_a_peer_that_comes_back_adopts_a_base_and_agrees(begin):
    _, peers = after(gossip(5, begin, speed=0.3, seconds=8, quiet=4))
    ann = peers["ann"]
    base = ann.base()
    late = SharedRanges("bob", PEERS, begin, speed_m_s=0.3)
    own = late.record(0.05, (3.0, 3.0), 4.0, 0.4)
    assert late.adopt(base)
    assert not late.adopt(base)
    assert late.late == (0 if own.number in base.heard["bob"] else 1)
    late.receive(ann.delta(late.digest(0.1)))
    assert numbers_of(late.state_at(15)) == numbers_of(ann.state_at(15))
    assert SharedRanges("bob", PEERS, begin).base() is None


def test_states_are_copies():
    shared = SharedRanges("ann", PEERS, RangeFilter)
    shared.record(0.0, (0, 0), 5.0, 0.5)
    first = shared.state_at(0)
    first.measure((9, 9), 9.0, 0.1)
    assert numbers_of(shared.state_at(0)) != numbers_of(first)


def test_snapshots_contain_the_target_in_any_order_of_fusion():
    rng = np.random.default_rng(7)
    for _ in range(25):
        target, speed = rng.uniform(-9, 9, 2), 0.7
        path = target + np.cumsum(np.vstack([np.zeros(2), rng.uniform(-0.49, 0.49, (9, 2))]), axis=0)
        snapshots = []
        for peer in range(4):
            filter_, last = RangeFilter(), None
            for t in sorted(rng.choice(10, 6, replace=False)):
                if last is not None:
                    filter_.predict(speed * (t - last))
                last, anchor = t, rng.uniform(-12, 12, 2)
                filter_.measure(anchor, max(0, np.hypot(*(path[t] - anchor)) + rng.choice([-0.4, 0.4])), 0.4)
            # The sender's clock is off by up to 0.2 s.
            snapshots.append(TimedSnapshot(float(last) + rng.uniform(-0.2, 0.2) * (peer > 0), filter_.snapshot()))
        held = predict_snapshot(snapshots[0], 9.0, speed)
        for other in rng.permutation(3) + 1:
            before = volume(held)
            held = fuse_snapshots(held, snapshots[other], speed, 0.2)
            assert not isinstance(held, EmptyIntersection)
            assert volume(held) <= before * (1 + 1e-9)
            assert inside(held, path[9])
        assert volume(fuse_snapshots(held, held)) == pytest.approx(volume(held), rel=1e-6)


def test_snapshots_that_contradict_each_other_are_told():
    one, other = RangeFilter(), RangeFilter()
    for anchor in ((0, 0), (8, 0), (0, 8)):
        one.measure(anchor, np.hypot(*np.subtract(anchor, (3, 4))), 0.2)
        other.measure(anchor, np.hypot(*np.subtract(anchor, (-6, 1))), 0.2)
    a, b = TimedSnapshot(0.0, one.snapshot()), TimedSnapshot(0.0, other.snapshot())
    assert isinstance(fuse_snapshots(a, b), EmptyIntersection)
    assert not isinstance(fuse_snapshots(a, b, speed_m_s=2.0, clock_bound_s=10.0), EmptyIntersection)
    with pytest.raises(NotASnapshot, match="finite"):
        predict_snapshot(a, float("nan"), 1.0)
    with pytest.raises(NotASnapshot, match="14 finite numbers"):
        fuse_snapshots(a, TimedSnapshot(0.0, deepcopy(a.held).__class__((0, 0), (0, 0, 0), (0.0,) * 9)))


def volume(snapshot):
    filter_ = RangeFilter()
    filter_.restore(snapshot.held)
    return filter_.volume


def inside(snapshot, point):
    filter_ = RangeFilter()
    filter_.restore(snapshot.held)
    return bool(filter_.feasible_set().contains(point))


def ranges_of(source, numbers, begin_s=0.0):
    return [TimedRange(source, number, begin_s + number, (0.0, 0.0), 5.0, 0.5) for number in numbers]


def test_a_peer_that_starts_again_counts_its_ranges_anew_under_another_name():
    before = SharedRanges("ann", ("ann", "bob"), RangeFilter, source="ann.0")
    after_ = SharedRanges("ann", ("ann", "bob"), RangeFilter, source="ann.1")
    old = before.record(1.0, (0, 0), 5.0, 0.5)
    new = after_.record(2.0, (0, 0), 5.0, 0.5)
    assert (old.peer, old.number, new.peer, new.number) == ("ann.0", 0, "ann.1", 0)
    bob = SharedRanges("bob", ("ann", "bob"), RangeFilter)
    assert bob.receive([old, new]) == 2
    bob.note(after_.digest(3.0))
    assert bob.fold(3.0) == 0, "the new one has not the old range yet"
    after_.receive([old])
    bob.note(after_.digest(4.0))
    bob.digest(4.0)
    assert bob.fold(4.0, keep_s=2.5) == 1, "the second is too young"
    assert bob.fold(4.0) == 1


def test_who_is_sent_a_delta_is_told_when_that_is_not_enough():
    ann, bob = (SharedRanges(name, ("ann", "bob"), RangeFilter, horizon_s=5) for name in ("ann", "bob"))
    ann.receive(ranges_of("cid", range(20)))
    assert not ann.needs_base(bob.digest(20.0))
    ann.fold(20.0)
    assert ann.needs_base(bob.digest(20.0))
    bob.receive(ann.delta(bob.digest(20.0)))
    assert ann.needs_base(bob.digest(20.0))
    assert bob.adopt(ann.base())
    assert not ann.needs_base(bob.digest(20.0))
    assert numbers_of(bob.state_at(20)) == numbers_of(ann.state_at(20))
    assert bob.fingerprint(21.0) == ann.fingerprint(21.0)


def test_of_two_that_each_lack_folded_ranges_the_one_with_more_is_gone_on_from():
    """And what was folded after its end, by who goes on from it, is kept."""
    ann, bob = (SharedRanges(name, ("ann", "bob"), RangeFilter, horizon_s=5) for name in ("ann", "bob"))
    ann.receive(ranges_of("cid", range(20)))
    bob.receive(ranges_of("dee", range(4), 14.0))
    ann.fold(18.5)
    bob.fold(22.0)
    assert bob.base().key > ann.base().key
    assert not ann.adopt(bob.base())
    assert bob.adopt(ann.base())
    assert not bob.adopt(ann.base())
    assert [record.key for record in bob.log] == [record.key for record in ranges_of("dee", range(4), 14.0)]
    ann.receive(bob.delta(ann.digest(23.0)))
    bob.receive(ann.delta(bob.digest(23.0)))
    assert numbers_of(ann.state_at(23)) == numbers_of(bob.state_at(23))
    assert ann.fingerprint(30.0) == bob.fingerprint(30.0) is not None


def test_fingerprints_tell_logs_apart_and_survive_folding():
    ann = SharedRanges("ann", ("ann", "bob"), RangeFilter, horizon_s=5)
    ann.receive(ranges_of("cid", range(20)))
    before = [ann.fingerprint(time_s) for time_s in range(21)]
    assert len(set(before)) == 21
    assert ann.fold(20.0) == 15
    assert [ann.fingerprint(time_s) for time_s in range(21)] == [None] * 15 + before[15:]
    other = SharedRanges("bob", ("ann", "bob"), RangeFilter)
    other.receive(reversed(ranges_of("cid", range(20))))
    assert [other.fingerprint(time_s) for time_s in range(21)] == before

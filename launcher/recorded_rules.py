"""What must not happen in a team that is led, looked for in a recording.

The same rules as in simulation (:mod:`launcher.order_rules`, :mod:`launcher.tree_rules`), as far as they can be told by
what every peer recorded about itself: whom it obeyed, what it ordered, what it took, which links it confirmed and which
it kept. Nobody is judged by what another believes of it.

A process that is killed loses what it recorded in its last moments. So what a peer should have recorded before a moment
is missed only if its recording goes on after that.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Final, TypeVar

from agents.records import Advance, AnyRecord, Decision, Office, Ordered, Taken, TopologyChange, TreeAnswer
from launcher.spells import SILENT_S, Spell
from launcher.tree_rules import spans
from protocol.negotiation import ROUNDS

SLACK_S: Final = 0.005
"""Records of different processes are taken for simultaneous within this time."""

WALL_SLACK_S: Final = 0.05
"""Clocks that tell the time of day run apart from those of missions by no more than this."""

TAKING_S: Final = 0.25
"""Who takes the orders of another leader records so soon that it obeys."""

ROUNDING_S: Final = 1e-6

Number = tuple[int, int]
"""Of a tree: epoch, and number in it."""

Kind = TypeVar("Kind", bound=AnyRecord)


class RecordedRules:
    """See the module.

    Args:
        led: who led, by time.
        obeyed: who obeyed whom, by time.
        records: mission time, peer, record; by time.
    """

    def __init__(
        self, led: Sequence[Spell], obeyed: Sequence[Spell], records: Sequence[tuple[float, str, AnyRecord]]
    ) -> None:
        self._led, self._obeyed, self._records = led, obeyed, records
        self._times_s: dict[str, list[float]] = defaultdict(list)
        self._restarts_s: dict[str, list[float]] = defaultdict(list)
        """When a process of a peer said first that it is another one."""
        incarnations: dict[str, int] = {}
        for time_s, peer, record in records:
            self._times_s[peer].append(time_s)
            if isinstance(record, Office):
                if incarnations.get(peer, record.incarnation) != record.incarnation:
                    self._restarts_s[peer].append(time_s)
                incarnations[peer] = record.incarnation
        self._voters = incarnations.keys()
        self._in_force_s: dict[Number, float] = {}
        """When each tree was put in force first."""
        for time_s, _, change in self._all(TopologyChange):
            if change.committed:
                self._in_force_s.setdefault(change.number, time_s)

    def broken(self, epoch_unix_s: float | None) -> Iterator[str]:
        """Rules that did not hold, as sentences; see :func:`launcher.reigns.find_reigns`."""
        yield from self._offices()
        yield from self._orders()
        yield from self._obedience(epoch_unix_s)
        yield from self._trees()
        yield from self._links_kept()
        yield from self._releases()

    def _all(self, kind: type[Kind]) -> Iterator[tuple[float, str, Kind]]:
        return ((time_s, peer, record) for time_s, peer, record in self._records if isinstance(record, kind))

    def _offices(self) -> Iterator[str]:
        """One leads, and one is obeyed, at a time; epochs rise."""
        for one, other in _overlaps(self._led):
            epochs = f"{one.epoch} and {other.epoch}"
            yield f"{one.peer} and {other.peer} both led at {other.from_s:.2f} s, in epochs {epochs}"
        for one, other in _overlaps(self._obeyed):
            yield (
                f"{one.peer} obeyed {one.leader} in epoch {one.epoch} while {other.peer} obeyed {other.leader} in "
                f"epoch {other.epoch}, at {other.from_s:.2f} s"
            )
        for before, after in pairwise(self._led):
            if after.reign != before.reign and after.epoch <= before.epoch:
                yield f"{after.peer} led in epoch {after.epoch} at {after.from_s:.2f} s, after epoch {before.epoch}"
        latest: dict[str, Spell] = {}
        for spell in self._obeyed:
            last = latest.get(spell.peer)
            if last is not None and spell.epoch < last.epoch:
                yield f"{spell.peer} obeyed epoch {spell.epoch} at {spell.from_s:.2f} s, after {last.epoch}"
            latest[spell.peer] = spell

    def _orders(self) -> Iterator[str]:
        """Orders are given in office only."""
        for time_s, peer, record in self._records:
            epoch = _epoch_of(record)
            if epoch is not None and not any(
                spell.peer == peer
                and spell.epoch == epoch
                and spell.from_s - SLACK_S <= time_s <= spell.until_s + SLACK_S
                for spell in self._led
            ):
                yield f"{peer} gave orders in epoch {epoch} at {time_s:.2f} s, when it did not lead"

    def _obedience(self, epoch_unix_s: float | None) -> Iterator[str]:
        """Orders are taken of who is obeyed, in their order, and before the lease has ended that they were given in."""
        before: dict[str, Taken] = {}
        plans: dict[str, tuple[int, int, int]] = {}
        for time_s, peer, taken in self._all(Taken):
            order, what = (taken.epoch, taken.sequence), f"{peer} took order {taken.epoch}.{taken.sequence}"
            last = before.get(peer)
            if last is not None and order <= (last.epoch, last.sequence):
                yield f"{what} at {time_s:.2f} s, after {last.epoch}.{last.sequence}"
            before[peer] = taken
            if taken.motion is not None:
                plan = taken.epoch, *taken.motion
                if plan < plans.get(peer, plan):
                    yield f"{what} at {time_s:.2f} s, which is of an older plan than it had taken"
                plans[peer] = plan
            if self._goes_on(peer, time_s) and not any(
                spell.peer == peer
                and (spell.epoch, spell.leader) == (taken.epoch, taken.leader)
                and spell.from_s - TAKING_S <= time_s <= spell.until_s + SLACK_S
                for spell in self._obeyed
            ):
                yield f"{what} of {taken.leader} at {time_s:.2f} s, when it did not obey it"
            if epoch_unix_s is not None:
                late_s = time_s - (taken.sent_at_s - epoch_unix_s) - taken.lease_s
                if late_s > WALL_SLACK_S:
                    yield f"{what} at {time_s:.2f} s, {late_s:.2f} s after the lease that it was given in"

    def _trees(self) -> Iterator[str]:
        """Trees join whom they name, are numbered in order, and confirmed by both ends of each new link, in time."""
        confirmed: dict[tuple[str, Number], dict[str, float]] = defaultdict(dict)
        for time_s, peer, answer in self._all(TreeAnswer):
            if answer.proposal is not None:
                for other in answer.confirmed:
                    confirmed[peer, answer.proposal].setdefault(other, time_s)
        latest: dict[int, int] = {}
        for time_s, _, change in self._all(TopologyChange):
            epoch, number = change.number
            what = f"the tree {epoch}.{number} of {time_s:.2f} s"
            if change.rounds > ROUNDS:
                yield f"{what} was proposed {change.rounds} times"
            if not change.committed:
                continue
            if not spans(change.members, change.edges):
                yield f"{what} is none: {change.edges} do not join {change.members}"
            if number <= latest.get(epoch, -1):
                yield f"{what} came into force after {epoch}.{latest[epoch]}"
            latest[epoch] = number
            for end, other in (ends for link in change.new for ends in (link, link[::-1])):
                if end not in self._voters or end in change.absent or not self._goes_on(end, time_s):
                    continue
                if confirmed[end, change.number].get(other, math.inf) > time_s + SLACK_S:
                    yield f"{what} was in force before {end} had confirmed its link with {other}"

    def _links_kept(self) -> Iterator[str]:
        """Links are kept until another tree is in force, and nobody goes back to an earlier one."""
        kept: dict[str, Number] = {}
        for time_s, peer, answer in self._all(TreeAnswer):
            number = answer.kept
            if number is None:
                kept.pop(peer, None)  # another process
                continue
            if number < kept.get(peer, number):
                yield f"{peer} went back at {time_s:.2f} s to the tree {number[0]}.{number[1]}"
            if number == kept.get(peer):
                continue
            kept[peer] = number
            since_s = self._in_force_s.get(number, math.inf)
            if since_s > time_s + SLACK_S and self._has_all_of(number[0], time_s):
                yield f"{peer} kept the links of {number[0]}.{number[1]} at {time_s:.2f} s, which was not in force"

    def _releases(self) -> Iterator[str]:
        """Nothing more is released of a motion while the tree that it leads to is being negotiated."""
        released: dict[tuple[str, int, int, int], list[tuple[float, int]]] = defaultdict(list)
        """By leader, epoch, plan and revision: when which stage was the last that anybody might begin."""
        for time_s, peer, order in self._all(Ordered):
            motion = order.motion
            released[peer, order.epoch, motion.plan, motion.revision].append((time_s, motion.released))
        for time_s, peer, advance in self._all(Advance):
            released[peer, advance.epoch, advance.plan, advance.revision].append((time_s, advance.released))
        for time_s, peer, change in self._all(TopologyChange):
            if change.motion is None:
                continue
            epoch, number = change.number
            entries = released[peer, epoch, *change.motion]
            begun_s = time_s - change.duration_s + ROUNDING_S
            before = max((stage for at_s, stage in entries if at_s <= begun_s), default=None)
            for at_s, stage in entries:
                if before is not None and stage > before and begun_s < at_s < time_s - ROUNDING_S:
                    yield (
                        f"{peer} released stage {stage} of plan {epoch}.{change.motion[0]} at {at_s:.2f} s, while the "
                        f"tree {epoch}.{number} that it leads to was being negotiated"
                    )
                    break

    def _goes_on(self, peer: str, time_s: float) -> bool:
        """Whether a process that ran then recorded more soon after: so what it recorded before is not lost."""
        times_s = self._times_s[peer]
        following = bisect_right(times_s, time_s)
        restarted = any(abs(restart_s - time_s) <= SILENT_S for restart_s in self._restarts_s[peer])
        return following < len(times_s) and times_s[following] - time_s <= SILENT_S and not restarted

    def _has_all_of(self, epoch: int, time_s: float) -> bool:
        """Whether all is there that whoever led in an epoch recorded until then."""
        reigns = [spell for spell in self._led if spell.epoch == epoch]
        return bool(reigns) and all(self._goes_on(spell.peer, min(spell.until_s, time_s)) for spell in reigns)


def _overlaps(spells: Sequence[Spell]) -> Iterator[tuple[Spell, Spell]]:
    """Pairs of spells of different leaders at one time. O(n²) in the worst case.

    A leader may move to a higher epoch within its lease; who has not heard of that yet obeys the same process.
    """
    for place, spell in enumerate(spells):
        for other in spells[place + 1 :]:
            if other.from_s >= spell.until_s - SLACK_S:
                break
            same = (other.leader, other.incarnation) == (spell.leader, spell.incarnation)
            if not same and other.until_s - other.from_s > SLACK_S:
                yield spell, other


def _epoch_of(record: AnyRecord) -> int | None:
    """Epoch of an order; None if it is none."""
    match record:
        case Decision():
            return record.deployment.authority.epoch
        case Ordered() | Advance():
            return record.epoch
        case TopologyChange(committed=True):
            return record.number[0]
    return None

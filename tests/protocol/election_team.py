"""A team that elects, in virtual time: clocks that drift, links that lose and delay, disks that take time, processes
that die, hang and come back. What must never happen is looked for after every event.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from functools import partial
from random import Random

from protocol.ballot import CLOCK_DRIFT
from protocol.core import Heard, Persist, Say, Tick, WakeAt, Written
from protocol.election import LEASE_S, Election, Event, Leads
from protocol.messages import Authority, Reign, VoteRequest, Warrant, addressee_of
from protocol.promises import decode_promise
from protocol.roster import Roster
from protocol.simulated_bus import VirtualTime

ORDER_EVERY_S = LEASE_S / 4


class Peer:
    """One process after another under one name, with one disk."""

    def __init__(self, name: str, rate: float, offset_s: float) -> None:
        self.name = name
        self.rate = rate
        self.offset_s = offset_s
        self.disk: bytes | None = None
        self.incarnation = -1
        self.mind: Election | None = None
        self.paused = False
        self.waiting: list[Callable[[], None]] = []
        """What arrived while it was paused."""
        self.wakings = 0
        """Asked for; only the last one counts."""
        self.writing: bytes | None = None
        self.orders = 0
        """Given by this process."""
        self.taken: tuple[int, int] = (-1, -1)
        """Epoch and sequence of the last order taken."""

    def clock_s(self, time_s: float) -> float:
        """What its clock shows; it goes on while the process does not."""
        return self.offset_s + self.rate * time_s


class Team:
    """Peers, their network and their disks; breaks off with AssertionError where a rule is broken.

    Args:
        voters: how many.
        seed: of all chance.
        kind: of elections, so that mutants can take part.
    """

    def __init__(self, voters: int, seed: int, kind: type[Election] = Election) -> None:
        names = ("base", *(f"robot{number}" for number in range(1, voters)))
        self.roster = Roster(names, ("agent",))
        self.time = VirtualTime()
        self.loss = 0.0
        self.delay_s = (0.001, 0.005)
        self.disk_s = (0.001, 0.005)
        self.cut: set[tuple[str, str]] = set()
        """Links on which nothing passes, from and to."""
        self.reigns: list[tuple[float, Reign]] = []
        """That began, and when."""
        self.taken = 0
        """Orders taken."""
        self.disks_lost = False
        self._seed = seed
        self._kind = kind
        self._chance = Random(f"{seed}/team")
        self.peers = {}
        for name in self.roster.names:
            rate = 1.0 + self._chance.choice((-1, 0, 1)) * CLOCK_DRIFT
            self.peers[name] = Peer(name, rate, self._chance.uniform(-1e4, 1e6))
            self.start(name)

    def run(self, seconds: float) -> None:
        """Let time pass."""
        self.time.run_until(self.time.now_s + seconds)

    def start(self, name: str) -> None:
        """Begin a process where there is none."""
        peer = self.peers[name]
        if peer.mind is not None:
            return
        peer.incarnation += 1
        peer.orders, peer.taken = 0, (-1, -1)
        promise = decode_promise(peer.disk, file="", team="t", voter=name, incarnation=peer.incarnation)
        peer.mind = self._kind(
            self.roster,
            team="t",
            name=name,
            incarnation=peer.incarnation,
            promise=promise,
            seed=self._seed,
            now_s=peer.clock_s(self.time.now_s),
        )
        self._handle(peer, Tick())
        self._order(peer, peer.incarnation)

    def kill(self, name: str, lose_disk: bool = False) -> None:
        """End a process; what it was writing may be on disk or not."""
        peer = self.peers[name]
        if peer.writing is not None and self._chance.random() < 0.5:
            peer.disk = peer.writing
        if lose_disk:
            peer.disk, self.disks_lost = None, True
        peer.mind, peer.writing, peer.paused, peer.waiting = None, None, False, []

    def pause(self, name: str) -> None:
        """Stop a process as SIGSTOP does."""
        self.peers[name].paused = self.peers[name].mind is not None

    def resume(self, name: str) -> None:
        """Let it go on; what has arrived is looked at, then its clock."""
        peer = self.peers[name]
        if peer.paused:
            peer.paused = False
            waiting, peer.waiting = peer.waiting, []
            for happen in waiting:
                happen()
            self._handle(peer, Tick())

    def part(self, group: Collection[str]) -> None:
        """Cut all links between a group and the others."""
        self.cut |= {(a, b) for a in self.peers for b in self.peers if (a in group) is not (b in group)}

    def heal(self) -> None:
        """End all faults."""
        self.loss, self.delay_s, self.disk_s = 0.0, (0.001, 0.005), (0.001, 0.005)
        self.cut.clear()
        for name in self.peers:
            self.resume(name)
            self.start(name)

    def leaders(self) -> list[Peer]:
        """Who believes now that it holds an unexpired lease, whether it runs or is stopped."""
        now_s = self.time.now_s
        return [peer for peer in self.peers.values() if peer.mind is not None and peer.mind.leads(peer.clock_s(now_s))]

    def obeys(self, name: str) -> Reign | None:
        """Whose orders are in force at a peer now."""
        peer = self.peers[name]
        return None if peer.mind is None else peer.mind.obedience.obeyed(peer.clock_s(self.time.now_s))

    def check(self) -> None:
        """At most one leads; all who obey obey the same, and nobody but the one who leads."""
        leaders = self.leaders()
        assert len(leaders) <= 1, f"{self.time.now_s:.4f}: {[peer.name for peer in leaders]} lead"
        obeyed = {(reign.leader, reign.incarnation) for name in self.peers if (reign := self.obeys(name)) is not None}
        assert len(obeyed) <= 1, f"{self.time.now_s:.4f}: {obeyed} are obeyed"
        if leaders and obeyed:
            assert obeyed == {(leaders[0].name, leaders[0].incarnation)}, f"{obeyed} obeyed, {leaders[0].name} leads"

    def _handle(self, peer: Peer, event: Event) -> None:
        """Give a process an event, and carry out what it wants."""
        assert peer.mind is not None
        time_s = self.time.now_s
        now_s, incarnation = peer.clock_s(time_s), peer.incarnation
        for effect in peer.mind.handle(event, now_s):
            match effect:
                case Say(body):
                    if isinstance(body, VoteRequest) and body.warrant is not None:
                        assert peer.mind.leads(now_s), "a warrant is said outside a lease"
                    hear = partial(self._hear, Heard(peer.name, incarnation, body))
                    self._send(peer, hear, addressee_of(body))
                case Persist(content, token):
                    peer.writing = content
                    self._later(self.disk_s, peer, partial(self._written, peer, content, token))
                case Leads(reign):
                    epochs = [earlier.epoch for _, earlier in self.reigns]
                    assert self.disks_lost or reign.epoch > max(epochs, default=0), f"{reign} after {epochs}"
                    self.reigns.append((time_s, reign))
                case WakeAt(wake_s) if wake_s < math.inf:
                    # Where the clocks' roundings differ it is woken a little late, never a little early.
                    due_s = max(0.0, (wake_s - now_s) / peer.rate) + 1e-6
                    peer.wakings += 1
                    self._later((due_s, due_s), peer, partial(self._wake, peer, peer.wakings))
        self.check()

    def _hear(self, heard: Heard, peer: Peer) -> None:
        self._handle(peer, heard)

    def _wake(self, peer: Peer, waking: int) -> None:
        if not peer.paused and waking == peer.wakings:
            self._handle(peer, Tick())

    def _written(self, peer: Peer, content: bytes, token: int) -> None:
        peer.disk, peer.writing = content, None
        self._arrive(peer, partial(self._handle, peer, Written(token)))

    def _order(self, peer: Peer, incarnation: int) -> None:
        """The duty of a leader: give an order now and then, and tell oneself too."""
        if peer.mind is None or peer.incarnation != incarnation:
            return
        now_s = peer.clock_s(self.time.now_s)
        warrant = None if peer.paused else peer.mind.warrant(now_s)
        if warrant is not None and peer.mind.office is not None:
            peer.orders += 1
            order = (Authority(epoch=peer.mind.office.epoch, leader=peer.name, sequence=peer.orders), warrant)
            self._take(peer, peer.name, incarnation, *order)
            self._send(peer, lambda other: self._take(other, peer.name, incarnation, *order))
        self._later((ORDER_EVERY_S, ORDER_EVERY_S), peer, partial(self._order, peer, incarnation))

    def _take(self, peer: Peer, leader: str, incarnation: int, authority: Authority, warrant: Warrant) -> None:
        """An order arrives. If it is taken nobody else leads, and it is later than any taken before."""
        assert peer.mind is not None
        reign = Reign(epoch=authority.epoch, leader=leader, incarnation=incarnation)
        if not peer.mind.obedience.take("deployment", authority, reign, warrant, peer.clock_s(self.time.now_s)):
            order = (authority.epoch, authority.sequence)
            assert self.disks_lost or order > peer.taken, f"{peer.name} takes {order} after {peer.taken}"
            peer.taken, self.taken = order, self.taken + 1
            self.check()

    def _send(self, sender: Peer, arrive: Callable[[Peer], None], to: str = "") -> None:
        for other in self.peers.values():
            if other is sender or to not in ("", other.name):
                continue
            if (sender.name, other.name) in self.cut or self._chance.random() < self.loss:
                continue
            for _ in range(1 + (self._chance.random() < self.loss / 2)):  # some arrive twice
                self._later(self.delay_s, other, partial(self._arrive, other, partial(arrive, other)))

    def _arrive(self, peer: Peer, happen: Callable[[], None]) -> None:
        if peer.paused:
            peer.waiting.append(happen)
        else:
            happen()

    def _later(self, delay_s: tuple[float, float], peer: Peer, happen: Callable[[], None]) -> None:
        """Do this after a while, if the process that is there now is still there then."""
        incarnation = peer.incarnation
        due_s = self.time.now_s + self._chance.uniform(*delay_s)
        self.time.call_at(due_s, lambda: happen() if peer.mind and peer.incarnation == incarnation else None)

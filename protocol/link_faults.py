"""Links of real processes that lose publications because somebody wants it: a table in a file that all peers map.

The launcher writes the table, one byte for each ordered pair of peers: how many per cent of what the one says do not
reach the other. Every peer's process reads it, in shared memory, whenever something arrives, so that a cut holds for
all peers at the same moment, for processes that are started later, and in one direction only if so wished. A process
that finds no table loses nothing: there is none unless a launcher on the same machine has made it.

What this does not emulate: publications are lost whole, after zenoh and the network of the machine have carried them.
So there is no delay, no backlog that arrives late when the link heals, no fragment lost and sent again by tcp, and no
new connection to be made. The token of a peer that is cut off goes when zenoh's lease would have run out, and comes
back at once.
"""

from __future__ import annotations

import mmap
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from random import Random
from typing import Final

from protocol import keys
from protocol.bus import BusEvent, Deliver, PeerAppeared, PeerVanished, Received

LINKS: Final = "links"
"""Name of the file in the folder of a run."""

CUT: Final = 100
"""Per cent: nothing passes."""

TOKEN_S: Final = 1.0
"""A token is missed so long after its link was cut: zenoh's lease."""

LOOK_S: Final = 0.05
"""How often a peer looks whose token it should see."""


class LinkTable:
    """Per cent lost from each speaker to each hearer.

    Args:
        file: of the table.
        names: of all peers, in the order that all agree on.
        create: make the file anew, with links that lose nothing.

    Raises:
        OSError: the file cannot be made, or read.
        ValueError: the file is not the table of a team of this size.
    """

    def __init__(self, file: Path, names: Sequence[str], *, create: bool = False) -> None:
        self.names = tuple(names)
        self._index = {name: place for place, name in enumerate(names)}
        size = len(names) ** 2
        if create:
            file.write_bytes(bytes(size))
        with file.open("r+b" if create else "rb") as opened:
            self._cells = mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_WRITE if create else mmap.ACCESS_READ)
        if len(self._cells) != size:
            raise ValueError(f"{file}: is no table of the links of {len(names)} peers; remove it")

    def lost_percent(self, speaker: str, hearer: str) -> int:
        """How much of what the one says does not reach the other; 0 if one of them is no peer."""
        i, j = self._index.get(speaker), self._index.get(hearer)
        return 0 if i is None or j is None else self._cells[i * len(self.names) + j]

    def lose(self, percent: Sequence[Sequence[int]]) -> None:
        """Write the whole table: ``percent[speaker][hearer]``, 0 to :data:`CUT`."""
        self._cells[:] = bytes(value for row in percent for value in row)

    def close(self) -> None:
        """Unmap the file."""
        self._cells.close()


class LinkFilter:
    """Stands before a peer's ``deliver`` and lets pass what the table lets pass.

    Args:
        table: of the links.
        name: of the peer that hears.
        deliver: where the rest goes; called from any thread.
        seed: of the losses.
    """

    def __init__(self, table: LinkTable, name: str, deliver: Deliver, seed: int) -> None:
        self._table = table
        self._name = name
        self._forward = deliver
        self._chance = Random(f"{seed}/{name}/links")
        self._lock = threading.Lock()
        self._tokens: set[str] = set()
        """Peers whose token zenoh sees."""
        self._shown: set[str] = set()
        """Those of them that the peer knows of."""
        self._cut_since_s: dict[str, float] = {}

    def watch(self) -> None:
        """Look at the table again and again from now on, in a thread that ends with the process."""
        threading.Thread(target=self._watch, name="links", daemon=True).start()

    def deliver(self, event: BusEvent) -> None:
        """Take an event of the bus. Any thread."""
        match event:
            case Received(key):
                address = keys.parse(key)
                lost = 0 if address is None or address.operator else self._lost(address.speaker)
                if lost == 0 or (lost < CUT and self._chance.random() * CUT >= lost):
                    self._forward(event)
            case PeerAppeared(peer):
                with self._lock:
                    self._tokens.add(peer)
                    if self._lost(peer) < CUT:
                        self._shown.add(peer)
                        self._forward(event)
            case PeerVanished(peer):
                with self._lock:
                    self._tokens.discard(peer)
                    if self._lost(peer) < CUT:
                        self._shown.discard(peer)
                        self._forward(event)

    def look(self, now_s: float) -> None:
        """Let tokens come and go as the table has it now; ``now_s`` is any clock that only goes forward."""
        with self._lock:
            cut = self._cut()
            for peer in [peer for peer in self._cut_since_s if peer not in cut]:
                del self._cut_since_s[peer]
            for peer in cut:
                if now_s - self._cut_since_s.setdefault(peer, now_s) >= TOKEN_S and peer in self._shown:
                    self._shown.discard(peer)
                    self._forward(PeerVanished(peer))
            for peer in sorted((self._tokens ^ self._shown) - cut):
                if peer in self._tokens:
                    self._shown.add(peer)
                    self._forward(PeerAppeared(peer))
                else:
                    self._shown.discard(peer)
                    self._forward(PeerVanished(peer))

    def _lost(self, speaker: str) -> int:
        return self._table.lost_percent(speaker, self._name)

    def _cut(self) -> set[str]:
        return {peer for peer in self._table.names if self._lost(peer) >= CUT}

    def _watch(self) -> None:
        while True:
            time.sleep(LOOK_S)
            self.look(time.monotonic())

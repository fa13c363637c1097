"""What can be wrong with the links of a simulated network, and one link, which has it happen to what it carries.

Each link draws from streams of its own, one for the delays of a good link and one for its faults. So what happens on
one link changes nothing on another, and a fault changes the delay of nothing that it does not touch.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from random import Random
from typing import Final, Literal

from protocol.bus import Received
from protocol.messages import MalformedMessage, decode

SPREAD: Final = 1.5
"""Standard deviation of the logarithm of log-normal delays."""


@dataclass(frozen=True, slots=True)
class Delays:
    """``least_s`` and a random time on top of it, of mean ``mean_s``. Uniform delays are at most twice the mean."""

    least_s: float
    mean_s: float
    tail: Literal["uniform", "exponential", "log-normal"] = "uniform"
    spikes: float = 0.0
    """Probability that it takes ``spike_s`` more."""
    spike_s: float = 0.0
    overtaking: bool = False
    """Whether what is said later can arrive earlier."""

    def draw(self, chance: Random) -> float:
        """One delay, seconds."""
        match self.tail:
            case "uniform":
                more_s = 2.0 * self.mean_s * chance.random()
            case "exponential":
                more_s = -self.mean_s * math.log(1.0 - chance.random())
            case "log-normal":
                more_s = self.mean_s * math.exp(SPREAD * chance.normalvariate() - 0.5 * SPREAD**2)
        return self.least_s + more_s + (self.spike_s if self.spikes and chance.random() < self.spikes else 0.0)


@dataclass(frozen=True, slots=True)
class LinkFaults:
    """What is wrong with one direction of a link."""

    cut: bool = False
    """Nothing that is said passes, and no token; what is on its way arrives."""
    loss: float = 0.0
    """Probability that a publication is lost."""
    burst: float = 1.0
    """Mean number of publications lost in a row; 1: each by itself."""
    duplicates: float = 0.0
    """Probability that a publication arrives twice."""
    corrupted: float = 0.0
    """Probability that it arrives as something that is no message. What a checksum would not find does not happen."""
    delays: Delays | None = None
    """None: those of the network."""


SOUND: Final = LinkFaults()


class Link:
    """From one speaker to one hearer.

    Args:
        name: of this link in its network of this seed.
        delays: while it is sound; uniform ones.
    """

    __slots__ = (
        "_chance",
        "_delays",
        "_last_arrival_s",
        "_last_token_s",
        "_losing",
        "_luck",
        "_name",
        "_spread_s",
        "faults",
        "token",
    )

    def __init__(self, name: str, delays: Delays) -> None:
        self.faults = SOUND
        self.token = 0
        """Number of the speaker's attachment whose token the hearer sees, or is about to; 0: none."""
        self._name = name
        self._delays = delays
        self._spread_s = 2.0 * delays.mean_s
        self._chance = Random(f"{name}/delay")
        self._luck: Random | None = None
        self._losing = False
        self._last_arrival_s = self._last_token_s = 0.0

    def carry(self, now_s: float) -> float:
        """When what is sent now arrives, behind what is on its way, whatever is wrong with the link."""
        arrival_s = now_s + self._delays.least_s + self._spread_s * self._chance.random()
        if arrival_s < self._last_arrival_s:
            return self._last_arrival_s
        self._last_arrival_s = arrival_s
        return arrival_s

    def carry_token(self, now_s: float) -> float:
        """When a token arrives that goes or comes now: behind all that was said before, and the tokens before."""
        self._last_token_s = max(self.carry(now_s), self._last_token_s)
        return self._last_token_s

    def heal(self) -> None:
        """Begin afresh, as a new connection does: nothing waits behind what is still on its way."""
        self._last_arrival_s, self._losing = 0.0, False

    def carry_badly(self, publication: Received, now_s: float) -> Iterator[tuple[float, Received]]:
        """When and as what a publication arrives that is sent now: not at all, once or twice."""
        faults, luck = self.faults, self._luck or Random(f"{self._name}/faults")
        self._luck = luck
        sound_delay_s = self._delays.draw(self._chance)
        if faults.cut or self._is_lost(faults, luck):
            return
        delays, delay_s = self._delays, sound_delay_s
        if faults.delays is not None:
            delays, delay_s = faults.delays, faults.delays.draw(luck)
        arrival_s = now_s + delay_s
        if not delays.overtaking:
            self._last_arrival_s = arrival_s = max(arrival_s, self._last_arrival_s)
        yield arrival_s, _corrupt(publication, luck) if luck.random() < faults.corrupted else publication
        if luck.random() < faults.duplicates:
            yield arrival_s + delays.draw(luck), publication

    def _is_lost(self, faults: LinkFaults, luck: Random) -> bool:
        """By itself, or in bursts: a chain of two states, one that loses all and one that loses nothing."""
        if faults.burst <= 1.0 or faults.loss >= 1.0:
            return luck.random() < faults.loss
        ends = 1.0 / faults.burst
        begins = ends * faults.loss / (1.0 - faults.loss)
        self._losing = luck.random() < (1.0 - ends if self._losing else begins)
        return self._losing


def _corrupt(publication: Received, luck: Random) -> Received:
    """Some bytes changed, cut off or put in between, so that it is no message any more."""
    payload = bytearray(publication.payload)
    place = luck.randrange(len(payload) + 1)
    match luck.randrange(3):
        case 0:
            del payload[place:]
        case 1:
            payload[place:place] = luck.randbytes(luck.randint(1, 8))
        case 2:
            payload[place : place + 4] = luck.randbytes(4)
    try:
        decode(bytes(payload))
    except MalformedMessage:
        return Received(publication.key, bytes(payload))
    return Received(publication.key, b"\xff" + payload)

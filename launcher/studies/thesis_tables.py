"""Tables 1 to 3 of thesis §4.1, as printed, and what §3.3.1 says of figures 25 and 26.

Transcribed from a text recognised by machine. Its numbers are whole: each row of Table 1 gives the number of holes of
its map by Euler's formula, but for room3 with bitangents, some of which meet in one point. Garbled is the caption of
Table 1, which explains La in the words for Lr; La are the segments of bitangents, three each. Figures 41 to 50 are lost
but for their captions, so of figures 44 to 50 only the slopes that are named there can be compared.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

Kind = Literal["inflection", "aspect"]


@dataclass(frozen=True, slots=True)
class Row:
    """One environment with one decomposition: its lines in Tables 1 and 2. Times are in seconds."""

    map: str
    kind: Kind
    """``inflection`` is "without bitangents" in the tables, ``aspect`` "with bitangents"."""
    V: int
    r: int
    Lb: int
    Lr: int
    La: int
    I: int  # noqa: E741 - the table's name
    N: int
    Td: float
    """Decomposition."""
    Tmv: float
    """Mutual visibility graph."""
    Tad: float
    """Adjacency graph."""
    Tpv: float
    """All shortest paths of the former."""
    Tpp: float
    """All shortest paths of the latter."""

    @property
    def segments(self) -> int:
        """L: line segments of walls, inflection rays and bitangents."""
        return self.Lb + self.Lr + self.La

    @property
    def holes(self) -> int:
        """Holes of the environment, by Euler's formula in general position."""
        return 1 + self.I - self.N - self.V - self.Lr + 2 * self.r + self.La // 3


ROWS: Final = (
    Row("room1", "inflection", 28, 12, 28, 20, 0, 49, 26, 0.000622, 0.0292, 0.00311, 0.00323, 0.00233),
    Row("room1", "aspect", 28, 12, 28, 20, 45, 205, 197, 0.003, 0.277, 0.076, 0.84, 0.342),
    Row("room2", "inflection", 34, 17, 34, 28, 0, 76, 48, 0.000946, 0.0538, 0.00545, 0.00973, 0.0115),
    Row("room2", "aspect", 34, 17, 34, 28, 54, 243, 233, 0.00379, 0.405, 0.111, 1.34, 0.532),
    Row("room3", "inflection", 64, 36, 64, 56, 0, 148, 98, 0.00201, 0.16, 0.0223, 0.0614, 0.0457),
    Row("room3", "aspect", 64, 36, 64, 56, 126, 645, 638, 0.0121, 2.8, 0.823, 22.8, 12.6),
    Row("cityblocks", "inflection", 68, 64, 68, 128, 0, 600, 517, 0.00655, 4.48, 0.634, 13.0, 6.4),
    Row("maze", "inflection", 82, 55, 82, 110, 0, 348, 259, 0.00461, 0.749, 0.161, 1.06, 0.751),
    Row("l457", "inflection", 225, 116, 225, 202, 0, 791, 594, 0.0144, 5.81, 0.807, 15.0, 9.75),
    Row("l457mod", "aspect", 18, 11, 18, 18, 24, 72, 65, 0.00141, 0.038, 0.00778, 0.0262, 0.0155),
)
"""Tables 1 and 2."""

COMPLEXITY: Final = {
    "decomposition": "O(L²)",
    "mutual visibility": "O(N²)",
    "adjacency": "O(N²)",
    "all pairs": "O(N³)",
    "Steiner tree": "O(3^k N + 2^k N²)",
    "redeployment, one tree": "O(k N²), not verified",
    "redeployment, all modifications": "O(k⁴ N²) to O(k⁵ N²)",
}
"""Table 3. N cells, L line segments, k terminals or robots."""

INVERSE_AREA: Final = (191.02, 1383.0)
"""Fig. 25: mean and standard deviation of 1 / area + 1 / area, over the pairs that see each other."""

EXPONENTIAL_AREA: Final = (1.25, 0.46)
"""Fig. 26: mean and standard deviation of exp(−area) + exp(−area), over the same pairs."""

AREA_WEIGHTS: Final = (0.0, 1.0, 5.0, 10.0, 30.0, 100.0)
"""Fig. 29: values of k_b."""

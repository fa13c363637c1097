"""Room on the disk of a run: there must be some before it begins, and when it runs out that is said at once.

A mission goes on without: its recordings end, and voters that cannot write vote no more (docs/election.md).
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Final

from launcher.scenario import ScenarioFault

TAKEN_B_S: Final = 15e3
"""By each peer: 12 kB a second in its own recording, 3 kB in the merged one (docs/recording.md)."""

LEAST_B: Final = 5e6
"""For everything else: map, logs, promises, and what merging needs."""

NEARLY_FULL_B: Final = 1e6
"""With less than this left somebody is told."""

BEGINNING_S: Final = 60.0
"""There must be room for so much of a run at least."""


def check_room(folder: Path, peers: int, duration_s: float | None) -> str:
    """Hold the room on a disk against what a run will take.

    Args:
        folder: on that disk.
        peers: how many record.
        duration_s: of the run; None: nobody knows.

    Returns:
        A warning, if a minute of it has room but not the whole; else nothing.

    Raises:
        ScenarioFault: there is not even that much.
    """
    free_b = shutil.disk_usage(folder).free
    beginning_b = _needed_b(peers, min(duration_s or BEGINNING_S, BEGINNING_S))
    if free_b < beginning_b:
        raise ScenarioFault(
            f"the disk of {folder.resolve()} has {_megabytes(free_b)} left, and the run takes "
            f"{_megabytes(beginning_b)} to begin with; make room, or change to a folder on another disk"
        )
    whole_b = _needed_b(peers, duration_s or BEGINNING_S)
    if free_b < whole_b:
        return f"there are {_megabytes(free_b)} left on the disk, and the whole run takes about {_megabytes(whole_b)}"
    return ""


class RoomWatch:
    """Says once that a disk is nearly full, and once more when that has happened again after there was room.

    Args:
        folder: on that disk.
        say: is told in a sentence.
    """

    def __init__(self, folder: Path, say: Callable[[str], None]) -> None:
        self._folder = folder
        self._say = say
        self._said = False

    def look(self) -> None:
        """Look once. A folder that is gone has no disk."""
        try:
            free_b = shutil.disk_usage(self._folder).free
        except OSError:
            return
        if free_b < NEARLY_FULL_B and not self._said:
            self._said = True
            self._say(
                f"only {_megabytes(free_b)} left on the disk of {self._folder}: make room, or recordings end, and "
                "voters that cannot write vote no more"
            )
        elif free_b > LEAST_B:
            self._said = False


def _needed_b(peers: int, duration_s: float) -> float:
    return LEAST_B + TAKEN_B_S * peers * duration_s


def _megabytes(size_b: float) -> str:
    return f"{size_b / 1e6:.1f} MB"

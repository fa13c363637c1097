"""What the launcher itself has to say of a run: on the console, and in the recording."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Final

from rich.console import Console

from agents.mission import Mission
from agents.recorder import RerunRecorder
from agents.records import Mishap
from launcher.console import tell
from launcher.run_folder import RECORDINGS

OBSERVER: Final = "launcher"
"""The launcher listens to its team as an operator of this name, and records under it."""


class Journal:
    """Says and records. The file begins with the first record: until the team has been forked it must not exist.

    Args:
        mission: its team and its time.
        folder: of the run.
        console: where to say things.
    """

    def __init__(self, mission: Mission, folder: Path, console: Console) -> None:
        self._mission = mission
        self._folder = folder
        self._console = console
        self._recorder: RerunRecorder | None = None

    def tell(self, text: str) -> None:
        """Say something of no importance to the recording."""
        tell(text, self._console)

    def crashed(self, peer: str, text: str) -> None:
        """A process ended that nobody wanted to end."""
        self.note(Mishap(kind="crash", who=(peer,), text=text))

    def revived(self, peer: str) -> None:
        """A peer that had been killed on purpose, or given up, has a process again."""
        self.note(Mishap(kind="kill", who=(peer,), text=f"{peer} is started again", over=True))

    def note(self, mishap: Mishap) -> None:
        """Say and record what befell the team; only say it where nothing can be written: a full disk stops nobody."""
        now_s = time.time() - self._mission.epoch_unix_s
        tell(f"{now_s:6.1f} s  {mishap.text}", self._console)
        try:
            if self._recorder is None:
                self._recorder = self._open()
            self._recorder.record(now_s, OBSERVER, mishap)
        except (OSError, RuntimeError) as problem:  # rerun has no exceptions of its own
            tell(f"Warning: that is not recorded: {problem}", self._console, "yellow")

    def close(self) -> None:
        """Finish the file, if there is one."""
        if self._recorder is not None:
            self._recorder.close()

    def _open(self) -> RerunRecorder:
        file = self._folder / RECORDINGS / f"{OBSERVER}.0.rrd"
        return RerunRecorder(file, team=self._mission.team, recording_id=self._folder.name, peer=OBSERVER)

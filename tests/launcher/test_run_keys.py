"""``sightline run`` on a terminal: what keys do to a running team, and that the terminal is afterwards as before."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import struct
import subprocess
import sys
import termios
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from tests.processes.test_run import PATIENCE_S, ROOMS, SCENARIO, SIGHTLINE, processes_of, wait_for

pytestmark = [pytest.mark.processes, pytest.mark.skipif(sys.platform != "linux", reason="looks for processes in /proc")]

# Whoever leads a session and opens a terminal has it as its own, and gets its Ctrl-C.
ON_TERMINAL = """
import os, sys
for descriptor in range(3):
    os.dup2(os.open(sys.argv[1], os.O_RDWR), descriptor)
os.execv(sys.argv[2], sys.argv[2:])
"""
ROWS, COLUMNS = 40, 160


class Screen:
    """A terminal on which ``sightline run`` runs. When the test ends its hang-up ends the run."""

    def __init__(self, folder: Path) -> None:
        self.keyboard, self.terminal = pty.openpty()
        fcntl.ioctl(self.terminal, termios.TIOCSWINSZ, struct.pack("HHHH", ROWS, COLUMNS, 0, 0))
        self.before = termios.tcgetattr(self.terminal)
        self.launcher = subprocess.Popen(
            [sys.executable, "-c", ON_TERMINAL, os.ttyname(self.terminal), SIGHTLINE, "run", "trial.toml"],
            cwd=folder,
            env=os.environ | {"TERM": "xterm"},
            start_new_session=True,
        )
        self._written = b""
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        with suppress(OSError):
            while written := os.read(self.keyboard, 65536):
                self._written += written

    @property
    def text(self) -> str:
        """All that has been shown, without colours and movements of the cursor."""
        return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", self._written.decode(errors="replace"))

    def press(self, key: str, pattern: str) -> re.Match[str]:
        """Press a key and wait until something is shown; again if just then nobody was known to lead."""
        while True:
            before = len(self.text)
            os.write(self.keyboard, key.encode())
            found = self.shows(f"{pattern}|Nobody is known to lead", before)
            if not found[0].startswith("Nobody"):
                return found

    def shows(self, pattern: str, since: int = 0) -> re.Match[str]:
        """Wait until something is shown."""
        found: list[re.Match[str]] = []

        def look() -> bool:
            found.extend(re.finditer(pattern, self.text[since:]))
            assert found or self.launcher.poll() is None, self.text
            return bool(found)

        wait_for(look, f"'{pattern}' on the terminal")
        return found[0]


@pytest.fixture
def screen(tmp_path: Path) -> Iterator[Screen]:
    (tmp_path / "rooms.json").write_text(ROOMS)
    (tmp_path / "trial.toml").write_text(SCENARIO)
    shown = Screen(tmp_path)
    yield shown
    if shown.launcher.poll() is None:
        shown.launcher.kill()
    shown.launcher.wait()
    os.close(shown.terminal)
    os.close(shown.keyboard)
    wait_for(lambda: not processes_of(tmp_path), "all processes to end")


def test_keys_cut_off_kill_and_pause_the_leader_and_ctrl_c_ends_the_run(screen: Screen) -> None:
    screen.shows("Keys: k kills the leader")
    screen.shows("base leads")
    cut = screen.press("c", r"(\w+) cut off from all others for 5 s")[1]
    os.write(screen.keyboard, b"h")
    screen.shows(f"over: {cut} cut off from all others for 5 s")
    killed = screen.press("k", r"(\w+) is killed for 5 s")[1]
    screen.shows(rf"(base|robot1|robot2)(?<!{killed}) leads", len(screen.text))
    paused = screen.press("p", r"(\w+) is paused for 3 s")[1]
    for leader in (cut, killed, paused):
        assert f"{leader} leads" in screen.text
    robot = next((robot for robot in ("robot1", "robot2") if robot not in (killed, paused)), paused)
    assert screen.press("x" + robot[-1], r"(\w+) is killed for 5 s")[1] == robot, "x means nothing"
    screen.press("\x03", r"Stopping \.\.\.")
    assert screen.launcher.wait(PATIENCE_S) == 130, screen.text
    assert termios.tcgetattr(screen.terminal) == screen.before
    assert "Traceback" not in screen.text

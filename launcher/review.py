"""What is left of a run: one recording out of many, the records in it, and a look at it.

The ``.rrd`` is the only source: the figures of a run are measured on the journal that :mod:`agents.recorder` writes
beside everything it draws.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.resources import files
from pathlib import Path

import msgspec
from rerun.chunk import RrdReader
from rerun.experimental import ViewerClient

from agents.recorder import JOURNAL
from agents.recorder_layout import TIMELINE
from agents.records import AnyRecord
from launcher.run_folder import RECORDINGS, RunFolder

_MERGING_S = 600.0
_VIEWER_START_S = 30.0
_VIEWER_DRAW_S = 15.0
_VIEWER_SETTLE_S = 6.0
"""Views load in the background, and the viewer's notices lie over them for a while; nothing tells when that is over."""
_PICTURE_SIZE = "1600x900"

_decoder = msgspec.json.Decoder(AnyRecord)


class RecordingFault(ValueError):
    """A recording that is missing or cannot be read; the text says which, why, and what to do."""


def merge(run_folder: Path) -> Path:
    """Make ``run.rrd`` out of what the processes of a run have written; what killed ones have left is repaired.

    Raises:
        RecordingFault: there is nothing to merge, or it cannot be merged.
    """
    if not run_folder.is_dir():
        raise RecordingFault(f"{run_folder}: there is no such folder; name the folder of a run, e.g. runs/latest")
    pieces = sorted((run_folder / RECORDINGS).glob("*.rrd"))
    if not pieces:
        raise RecordingFault(f"{run_folder}: no recording in it ({RECORDINGS}/*.rrd); did its processes ever start?")
    merged = RunFolder(run_folder).recording
    partial = merged.with_name(f".{merged.name}")
    command = [_rerun(), "rrd", "optimize", "--continue-on-error", *map(str, pieces), "-o", str(partial)]
    try:
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=_MERGING_S,
            env={**os.environ, "RUST_LOG": "error", "NO_COLOR": "1"},
        )
        if done.returncode != 0 or not partial.is_file():
            problem = (done.stderr.strip().splitlines() or ["no reason given"])[-1]
            raise RecordingFault(
                f"{run_folder}: rerun could not merge its recordings, which are kept: {problem}; "
                f"see to that, then say `sightline review {run_folder}`"
            )
        if not RrdReader(partial).recordings():
            raise RecordingFault(f"{run_folder / RECORDINGS}: none of its {len(pieces)} files can be read")
        partial.replace(merged)
    except subprocess.TimeoutExpired as problem:
        raise RecordingFault(f"{run_folder}: merging its recordings took more than {_MERGING_S:.0f} s") from problem
    except OSError as problem:
        raise RecordingFault(f"{run_folder}: rerun could not merge its recordings: {problem}") from problem
    finally:
        partial.unlink(missing_ok=True)
    return merged


def read_records(rrd: Path) -> list[tuple[float, str, AnyRecord]]:
    """Everything that was recorded: (mission time in seconds, peer, record), by time and then by peer.

    Raises:
        RecordingFault: the file is absent, damaged, not of this version, or not of a run.
    """
    if not rrd.is_file():
        raise RecordingFault(f"{rrd}: there is no such recording; name the folder of a run, or merge it again")
    records: list[tuple[float, str, AnyRecord]] = []
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a file without a footer is announced, and read all the same
            stream = RrdReader(rrd).stream().filter(content=f"/{JOURNAL}/**", components="TextDocument:text")
            for chunk in stream:
                peer = chunk.entity_path.rpartition("/")[2]
                batch = chunk.to_record_batch()
                times = batch.column(TIMELINE).cast("int64").to_pylist()
                for time_ns, texts in zip(times, batch.column("TextDocument:text").to_pylist(), strict=True):
                    records.extend((time_ns * 1e-9, peer, _decoder.decode(text)) for text in texts)
    except (RuntimeError, ValueError, KeyError) as problem:
        raise RecordingFault(
            f"{rrd}: not a recording of a run by this version, or damaged ({problem}); remove it, and `sightline "
            "review` merges it anew, or use the version that versions.json beside it names"
        ) from problem
    if not records:
        raise RecordingFault(f"{rrd}: no record of any peer in it; is it the recording of something else?")
    records.sort(key=lambda entry: entry[:2])
    return records


def open_viewer(rrd: Path) -> str:
    """Open a recording in rerun's viewer if there is a display; a sentence says what came of it."""
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return f"No display here; where there is one, `rerun {rrd}` shows the recording."
    try:
        subprocess.Popen(
            [_rerun(), str(rrd)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
    except OSError as problem:
        return f"The viewer does not start ({problem}); `rerun {rrd}` shows the recording where it does."
    return f"The recording {rrd} opens in rerun's viewer."


def draw_picture(rrd: Path, time_s: float, picture: Path) -> None:
    """Render the recording as the viewer shows it at a mission time, without a display, into a PNG.

    Raises:
        RecordingFault: there is no such recording, or this machine has no renderer.
    """
    if not rrd.is_file():
        raise RecordingFault(f"{rrd}: there is no such recording")
    picture.unlink(missing_ok=True)
    with _headless_viewer(rrd) as viewer:
        viewer.set_time(TIMELINE, duration=time_s, play_state="paused")
        time.sleep(_VIEWER_SETTLE_S)
        viewer.save_screenshot(str(picture.absolute()))
        _wait_for(picture.is_file, _VIEWER_DRAW_S, f"{picture}: the viewer did not write the picture")


@contextmanager
def _headless_viewer(rrd: Path) -> Iterator[ViewerClient]:
    """A viewer without a window that has loaded the recording."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    process = subprocess.Popen(
        [
            _rerun(),
            str(rrd),
            "--headless",
            "--hide-welcome-screen",
            *("--bind", "127.0.0.1", "--port", str(port), "--window-size", _PICTURE_SIZE),
        ],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    clients: list[ViewerClient] = []

    def loaded() -> bool:
        if process.poll() is not None:
            raise RecordingFault(
                f"{rrd}: no picture, since this machine has no renderer; on Debian, apt-get install mesa-vulkan-drivers"
            )
        try:
            if not clients:
                clients.append(ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy"))
            state = clients[0].get_state()
        except Exception:
            return False  # not yet listening
        return bool(state.recordings and state.views and not state.loading)

    try:
        _wait_for(loaded, _VIEWER_START_S, f"{rrd}: the viewer did not load the recording")
        yield clients[0]
    finally:
        process.terminate()
        process.wait()


def _wait_for(happened: Callable[[], bool], timeout_s: float, otherwise: str) -> None:
    """Look until it has happened. Raises RecordingFault with the sentence ``otherwise`` if it does not in time."""
    deadline_s = time.monotonic() + timeout_s
    while not happened():
        if time.monotonic() > deadline_s:
            raise RecordingFault(otherwise)
        time.sleep(0.1)


def _rerun() -> str:
    """The program itself: the console script of the same name leaves it running when it is stopped."""
    return str(files("rerun_cli") / "rerun")

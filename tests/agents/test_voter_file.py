"""Promises on a real disk."""

from __future__ import annotations

import os
from pathlib import Path
from queue import SimpleQueue

import pytest

from agents.voter_file import VoterFile
from protocol.core import Persist, Written
from protocol.messages import Reign
from protocol.promises import VoterFileFault, encode_promise

REIGN = Reign(epoch=3, leader="base", incarnation=0)


def promise(team: str = "team", voter: str = "robot1", incarnation: int = 0) -> bytes:
    return encode_promise(REIGN, team=team, voter=voter, incarnation=incarnation)


def write(file: VoterFile, content: bytes, token: int = 1) -> Written:
    done: SimpleQueue[Written] = SimpleQueue()
    file.serve(done.put)
    file.write(Persist(content, token))
    return done.get(timeout=30.0)


def test_what_is_written_is_read_by_the_next_process(tmp_path: Path) -> None:
    first = VoterFile(tmp_path, "robot1")
    assert first.read(team="team", incarnation=0) is None
    assert write(first, promise()) == Written(1)
    assert VoterFile(tmp_path, "robot1").read(team="team", incarnation=1) == REIGN
    assert [path.name for path in first.path.parent.iterdir()] == ["robot1.json"], "nothing else is left"


def test_is_on_disk_before_it_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The file is synchronised under another name, renamed, then the folder is."""
    calls: list[str] = []
    sync, rename = os.fsync, Path.rename

    def synchronise(descriptor: int) -> None:
        calls.append("fsync")
        sync(descriptor)

    def give_name(path: Path, to: Path) -> Path:
        calls.append("rename")
        return rename(path, to)

    monkeypatch.setattr(os, "fsync", synchronise)
    monkeypatch.setattr(Path, "rename", give_name)
    file = VoterFile(tmp_path, "robot1")
    file.read(team="team", incarnation=0)
    calls.clear()
    write(file, promise())
    assert calls == ["fsync", "rename", "fsync"]


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (promise(team="other"), "of team other, not those of robot1 of team team"),
        (promise(voter="robot2"), "holds the promises of robot2"),
        (promise(incarnation=5), "was written by incarnation 5 of robot1, and this is incarnation 1"),
        (promise()[:-20], "is cut short"),
        (promise().replace(b"3", b"4", 1), "is damaged"),
    ],
)
def test_a_file_that_is_not_its_own_or_damaged_is_not_voted_by(tmp_path: Path, content: bytes, what: str) -> None:
    file = VoterFile(tmp_path, "robot1")
    file.path.parent.mkdir()
    file.path.write_bytes(content)
    with pytest.raises(VoterFileFault, match=r"promises/robot1\.json") as fault:
        file.read(team="team", incarnation=1)
    assert what in str(fault.value)
    assert file.path.read_bytes() == content, "nothing is lost"


def test_who_cannot_write_does_not_join(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(VoterFileFault, match=r"No space left on device.*make room"):
        VoterFile(tmp_path, "robot1").read(team="team", incarnation=0)


def test_a_disk_that_fills_up_later_is_told_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = VoterFile(tmp_path, "robot1")
    file.read(team="team", incarnation=0)

    def full(_descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    written = write(file, promise(), token=7)
    assert written.token == 7
    assert "No space left on device" in written.failure
    assert not file.path.exists()

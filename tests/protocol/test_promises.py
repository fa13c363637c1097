"""A voter's file is what it was, or its peer does not vote by it and says why in one sentence."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.messages import Reign
from protocol.promises import MAXIMUM_BYTES, VoterFileFault, decode_promise, encode_promise

PROMISE = Reign(epoch=7, leader="base", incarnation=2)
CONTENT = encode_promise(PROMISE, team="demo", voter="robot1", incarnation=4)
COUNTS = st.integers(0, 2**53 - 1)


def decode(content: bytes | None, team: str = "demo", voter: str = "robot1", incarnation: int = 5) -> Reign | None:
    return decode_promise(content, file="voters/robot1", team=team, voter=voter, incarnation=incarnation)


def fault(content: bytes | None, team: str = "demo", voter: str = "robot1", incarnation: int = 5) -> str:
    with pytest.raises(VoterFileFault) as problem:
        decode(content, team, voter, incarnation)
    text = str(problem.value)
    assert text.startswith("voters/robot1 ")
    assert "\n" not in text
    return text


@given(COUNTS, st.sampled_from(["base", "robot1", "x" * 32]), COUNTS, st.integers(0, 2**53 - 2))
def test_what_is_written_is_read(epoch: int, leader: str, incarnation: int, writer: int) -> None:
    promise = Reign(epoch=epoch, leader=leader, incarnation=incarnation)
    content = encode_promise(promise, team="demo", voter="robot1", incarnation=writer)
    assert decode(content, incarnation=writer + 1) == promise
    assert len(content) <= MAXIMUM_BYTES


def test_no_file_is_no_promise() -> None:
    assert decode(None) is None


@pytest.mark.parametrize("length", range(len(CONTENT)))
def test_a_file_that_is_cut_short_anywhere_is_a_fault(length: int) -> None:
    assert "is cut short" in fault(CONTENT[:length])


@given(st.integers(0, len(CONTENT) - 1), st.integers(1, 255))
def test_a_file_with_a_wrong_byte_is_a_fault(place: int, change: int) -> None:
    damaged = bytearray(CONTENT)
    damaged[place] ^= change
    text = fault(bytes(damaged))
    assert "damaged" in text or "cut short" in text
    assert "delete it" in text


@given(st.binary(max_size=300))
def test_noise_is_a_fault(content: bytes) -> None:
    fault(content)


def test_a_file_of_another_team_or_voter_or_version_is_a_fault() -> None:
    assert "of robot1 of team demo, not those of robot1 of team rescue" in fault(CONTENT, team="rescue")
    assert "not those of robot2 of team demo" in fault(CONTENT, voter="robot2")
    line = CONTENT.partition(b"\n")[0].replace(b'"schema":1', b'"schema":2')
    from zlib import crc32

    assert "another version" in fault(line + b"\ncrc32 %08x\n" % crc32(line))
    assert "damaged" in fault(CONTENT + b"x" * MAXIMUM_BYTES)


@pytest.mark.parametrize("incarnation", [0, 3, 4])
def test_a_file_of_a_process_that_began_later_or_bears_the_same_number_is_a_fault(incarnation: int) -> None:
    text = fault(CONTENT, incarnation=incarnation)
    assert "start robot1 with incarnation 5 or later" in text

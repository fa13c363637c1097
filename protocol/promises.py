"""The voter's file: the last promise that it made, kept so that it does not forget it with its process.

Two lines of text::

    {"schema":1,"team":"demo","voter":"robot1","incarnation":2,"promise":{"epoch":3,"leader":"base","incarnation":0}}
    crc32 5d3ab1f0

The first is JSON, the second the checksum of the first. This module makes and reads the bytes; who writes them follows
:class:`protocol.core.Persist`, so that a file is never half a file. One that is damaged nevertheless is a fault of the
disk or of people, and its peer does not take part rather than vote twice.
"""

from __future__ import annotations

from typing import Final, Literal
from zlib import crc32

import msgspec

from protocol.messages import Count, Name, Reign

MAXIMUM_BYTES: Final = 4096
"""A longer file is none of ours."""


class VoterFileFault(ValueError):
    """A voter's file that its peer must not vote by; the text names the file, what is wrong and the remedy."""


class _Content(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    schema: Literal[1] = 1
    team: Name
    voter: Name
    incarnation: Count
    """Of the process that wrote the file."""
    promise: Reign


def encode_promise(promise: Reign, *, team: str, voter: str, incarnation: int) -> bytes:
    """Content of a voter's file."""
    line = msgspec.json.encode(_Content(team=team, voter=voter, incarnation=incarnation, promise=promise))
    return line + b"\n" + _checksum(line)


def decode_promise(content: bytes | None, *, file: str, team: str, voter: str, incarnation: int) -> Reign | None:
    """The last promise of a voter.

    Args:
        content: of the file; None if there is none. A voter without one has never promised anything, or has lost its
            disk; it cannot tell which.
        file: its name, for the text of faults.
        team: of the process that is to vote by it.
        voter: its name.
        incarnation: of that process.

    Raises:
        VoterFileFault: the file is cut short or damaged, of another team, voter or version, or was written by a
            process that began after this one or with the same number.
    """
    if content is None:
        return None
    anew = (
        f"restore it, or delete it if no copy is left: {voter} then joins without it and waits a lease before it votes"
    )
    line, newline, checksum = content.partition(b"\n")
    if not newline or len(checksum) < len(_checksum(line)):
        raise VoterFileFault(f"{file} is cut short after {len(content)} bytes; {anew}")
    if len(content) > MAXIMUM_BYTES or checksum != _checksum(line):
        raise VoterFileFault(f"{file} is damaged, its checksum is wrong; {anew}")
    try:
        found = msgspec.json.decode(line, type=_Content)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as problem:
        raise VoterFileFault(f"{file} is of another version of Sightline ({problem}); {anew}") from problem
    if (found.team, found.voter) != (team, voter):
        raise VoterFileFault(
            f"{file} holds the promises of {found.voter} of team {found.team}, not those of {voter} of team {team}; "
            "name the folder of the right run"
        )
    if found.incarnation >= incarnation:
        raise VoterFileFault(
            f"{file} was written by incarnation {found.incarnation} of {voter}, and this is incarnation {incarnation}; "
            f"end the other process, and start {voter} with incarnation {found.incarnation + 1} or later"
        )
    return found.promise


def _checksum(line: bytes) -> bytes:
    return b"crc32 %08x\n" % crc32(line)

"""A timetable of faults: what goes wrong in a mission, when, and for whom. One TOML file, the same in both worlds.

    [[faults]]
    kind = "kill"            # the process ends, and begins again after for_s
    at_s = 12.0
    for_s = 3.0
    who = "leader"           # or a name on the roster

A fault begins at mission time ``at_s`` and lasts for ``for_s``; without that, until the mission ends. ``who`` is a name
on the roster, or ``leader``: whoever leads then, and if nobody does the next to lead. Where ``speakers`` or ``hearers``
of links are not given, all are meant. Faults of one kind on one link or peer do not add up: the one begun last holds.

Virtual time knows all of these (:mod:`launcher.simulation`); live teams are killed, paused and cut.
``docs/faults.md`` shows an example of each kind.
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeAlias

import msgspec
from msgspec import Meta

from launcher.wording import misfit
from protocol.messages import Name

LEADER: Final = "leader"
"""Stands for whoever leads when the fault is due."""

Moment = Annotated[float, Meta(ge=0.0, le=86400.0)]
Duration = Annotated[float, Meta(gt=0.0, le=86400.0)]
Wait = Annotated[float, Meta(ge=0.0, le=3600.0)]
Share = Annotated[float, Meta(ge=0.0, le=1.0)]
Names: TypeAlias = tuple[Name, ...]


class FaultyTimetable(ValueError):
    """A timetable that cannot be used; the text says file, place and remedy in one sentence."""


class _Fault(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="kind"):
    """Base of all faults."""

    at_s: Moment
    for_s: Duration | None = None

    @property
    def kind(self) -> str:
        """As in the file."""
        return str(self.__struct_config__.tag)

    @property
    def ends_s(self) -> float:
        """Mission time at which it is over."""
        return math.inf if self.for_s is None else self.at_s + self.for_s


class _PeerFault(_Fault, frozen=True, kw_only=True):
    who: Name


class _LinkFault(_Fault, frozen=True, kw_only=True):
    """On the links from each of the speakers to each of the hearers."""

    speakers: Names = ()
    hearers: Names = ()


class Kill(_PeerFault, frozen=True, kw_only=True, tag="kill"):
    """The process is gone at once; after ``for_s`` another one begins under the name, where the body stands."""

    disk: Literal["kept", "lost"] = "kept"
    """Whether the other one finds what this one had written."""
    noticed_after_s: Wait = 0.0
    """When the others see its token vanish, in virtual time: at once, as when a process ends, or late, as when its
    machine loses power. They do not if it is back by then."""


class Pause(_PeerFault, frozen=True, kw_only=True, tag="pause"):
    """The process stands still as after SIGSTOP; then all that has arrived is there at once."""

    speaking: bool = False
    """Whether, in virtual time, it is stopped in the middle of its next sentence: what it has decided to say is heard
    when the pause is over."""


class Partition(_Fault, frozen=True, kw_only=True, tag="partition"):
    """Nothing passes between a group and all others."""

    group: Annotated[Names, Meta(min_length=1)]
    noticed_after_s: Wait = 3600.0
    """When each side sees the tokens of the other vanish, in virtual time. They do not if it is over by then."""


class Cut(_LinkFault, frozen=True, kw_only=True, tag="cut"):
    """Nothing passes on these links; the other way it may."""


class Loss(_LinkFault, frozen=True, kw_only=True, tag="loss"):
    """Part of the publications is lost on these links."""

    share: Share
    burst: Annotated[float, Meta(ge=1.0, le=1000.0)] = 1.0
    """Mean number of publications lost in a row; 1: each by itself."""


class Delay(_LinkFault, frozen=True, kw_only=True, tag="delay"):
    """Publications on these links take ``least_s``, and a random time on top of it of mean ``mean_s``."""

    least_s: Wait = 0.001
    mean_s: Wait
    tail: Literal["uniform", "exponential", "log-normal"] = "exponential"
    """Distribution of the random time; the log-normal one has the heaviest tail (sigma 1.5)."""
    spikes: Share = 0.0
    """Share of publications that take ``spike_s`` more."""
    spike_s: Wait = 0.0
    overtaking: bool = False
    """Whether what is said later can arrive earlier; a link over tcp keeps its order."""


class Duplicate(_LinkFault, frozen=True, kw_only=True, tag="duplicate"):
    """Part of the publications arrives twice, the second time later."""

    share: Share


class Corrupt(_LinkFault, frozen=True, kw_only=True, tag="corrupt"):
    """Part of the publications arrives with some bytes changed, cut off or added."""

    share: Share


class Disk(_PeerFault, frozen=True, kw_only=True, tag="disk"):
    """The peer's disk is slow, or full."""

    takes_s: Wait = 0.003
    """Until what is written is there."""
    full: bool = False
    """Whether writing fails."""


class Clock(_PeerFault, frozen=True, kw_only=True, tag="clock"):
    """The peer's clock runs at another rate, and shows another time than the others'."""

    rate: Annotated[float, Meta(gt=0.0, le=10.0)] = 1.0
    """Its seconds in a true second. The election tolerates 0.95 to 1.05."""
    offset_s: Annotated[float, Meta(ge=-86400.0, le=86400.0)] = 0.0
    """By how much it is ahead. Only a process that begins later shows it: clocks in use do not jump."""


Fault: TypeAlias = Kill | Pause | Partition | Cut | Loss | Delay | Duplicate | Corrupt | Disk | Clock
PeerFault: TypeAlias = Kill | Pause | Disk | Clock
LinkFault: TypeAlias = Cut | Loss | Delay | Duplicate | Corrupt


class Timetable(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """All faults of a mission, in any order."""

    faults: tuple[Fault, ...] = ()

    @property
    def ends_s(self) -> float:
        """Mission time from which on nothing is amiss any more; infinite if that never comes."""
        return max((fault.ends_s for fault in self.faults), default=0.0)


def read_timetable(path: Path, peers: Collection[str]) -> Timetable:
    """Timetable of a TOML file, held against the names on the roster.

    Raises:
        FaultyTimetable: the file cannot be read, is no TOML, does not fit, or names a peer that is not on the roster.
    """
    try:
        raw = tomllib.loads(path.read_text(encoding="utf-8"))
        return checked(timetable_of(raw), peers)
    except OSError as problem:
        raise FaultyTimetable(f"{path}: cannot be read ({problem.strerror}); give the path of a TOML file") from problem
    except UnicodeDecodeError as problem:
        raise FaultyTimetable(f"{path}: is not text in UTF-8; save it as UTF-8") from problem
    except tomllib.TOMLDecodeError as problem:
        said = str(problem)
        raise FaultyTimetable(f"{path}: is not valid TOML, {said[:1].lower()}{said[1:]}; mend that line") from problem
    except RecursionError as problem:
        raise FaultyTimetable(f"{path}: is nested too deeply; a list of names is the deepest there is") from problem
    except FaultyTimetable as problem:
        raise FaultyTimetable(f"{path}: {problem}") from problem
    except ValueError as problem:  # the interpreter reads whole numbers of at most 4300 digits
        raise FaultyTimetable(f"{path}: holds a number of thousands of digits; give seconds and shares") from problem


def timetable_of(raw: dict[str, Any]) -> Timetable:
    """Timetable of a decoded file.

    Raises:
        FaultyTimetable: it does not fit.
    """
    try:
        return msgspec.convert(raw, Timetable)
    except msgspec.ValidationError as problem:
        raise FaultyTimetable(_explain(str(problem), raw)) from problem


def checked(timetable: Timetable, peers: Collection[str]) -> Timetable:
    """The timetable, if it fits this roster.

    Raises:
        FaultyTimetable: somebody is named who is not on the roster, or a pause has no end.
    """
    for place, fault in enumerate(timetable.faults):
        for key, name in _named(fault):
            if name not in peers and not (key == "who" and name == LEADER):
                known = ", ".join([*peers, *([LEADER] if key == "who" else [])])
                raise FaultyTimetable(f"faults[{place}].{key} names '{name}', who is not there; choose one of {known}")
        if isinstance(fault, Pause) and fault.for_s is None:
            raise FaultyTimetable(f"faults[{place}] pauses {fault.who} for ever; add for_s = 2.0, or kill it")
    return timetable


def write_timetable(timetable: Timetable) -> str:
    """TOML text of a timetable, which reads back as the same one; faults in order of time, defaults left out."""
    blocks = []
    for fault in sorted(timetable.faults, key=lambda fault: fault.at_s):
        lines = ["[[faults]]", f'kind = "{fault.kind}"']
        for key, default in zip(fault.__struct_fields__, _defaults(fault), strict=True):
            value = getattr(fault, key)
            if value != default:
                lines.append(f"{key} = {_toml(value)}")
        blocks.append("\n".join(lines) + "\n")
    return "\n".join(blocks)


def describe(fault: Fault) -> str:
    """What goes wrong, in a few words, without the time of it."""
    for_s = "" if fault.for_s is None else f" for {fault.for_s:g} s"
    match fault:
        case Kill(who=who, disk=disk):
            return f"{who} is killed{', its disk lost,' if disk == 'lost' else ''}{for_s}"
        case Pause(who=who, speaking=speaking):
            return f"{who} is paused{' in the middle of a sentence' if speaking else ''}{for_s}"
        case Partition(group=group):
            return f"{', '.join(group)} cut off from all others{for_s}"
        case Disk(who=who, takes_s=takes_s, full=full):
            return f"the disk of {who} {'is full' if full else f'takes {takes_s:g} s'}{for_s}"
        case Clock(who=who, rate=rate, offset_s=offset_s):
            return f"the clock of {who} runs at {rate:g} and is {offset_s:+g} s ahead{for_s}"
    return f"{_describe_link_fault(fault)} {_links(fault)}{for_s}"


def _describe_link_fault(fault: LinkFault) -> str:
    match fault:
        case Cut():
            return "nothing passes"
        case Loss(share=share, burst=burst):
            return f"{share:.0%} lost{f' in bursts of {burst:g}' if burst > 1.0 else ''}"
        case Delay(least_s=least_s, mean_s=mean_s, tail=tail, overtaking=overtaking):
            return f"{least_s:g} s + {tail} {mean_s:g} s of delay{', overtaking,' if overtaking else ''}"
        case Duplicate(share=share):
            return f"{share:.0%} twice"
        case Corrupt(share=share):
            return f"{share:.0%} corrupted"


def _links(fault: LinkFault) -> str:
    speakers, hearers = ", ".join(fault.speakers) or "all", ", ".join(fault.hearers) or "all"
    return "on all links" if speakers == hearers == "all" else f"from {speakers} to {hearers}"


def _named(fault: Fault) -> Iterator[tuple[str, str]]:
    """Whom it names, and under which key."""
    for key in ("who", "group", "speakers", "hearers"):
        value = getattr(fault, key, ())
        for name in (value,) if isinstance(value, str) else value:
            yield key, name


def _defaults(fault: Fault) -> tuple[Any, ...]:
    """A default for each field, NODEFAULT where there is none; kw_only structs count theirs from the end."""
    fields, defaults = fault.__struct_fields__, fault.__struct_defaults__
    return (msgspec.NODEFAULT,) * (len(fields) - len(defaults)) + defaults


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, tuple):
        return f"[{', '.join(map(_toml, value))}]"
    return repr(value)


def _explain(message: str, raw: dict[str, Any]) -> str:
    """A sentence with place and remedy for what msgspec says of a value that does not fit."""
    what, _, where = message.partition(" - at `$")
    place = where.rstrip("`").lstrip(".") or "the file"
    kinds = {str(kind.__struct_config__.tag): kind for kind in Fault.__args__}
    number = re.match(r"faults\[(\d+)\]", place)
    entry = raw["faults"][int(number[1])] if number else {}
    kind = kinds.get(str(entry.get("kind")) if isinstance(entry, dict) else "")
    if unknown := re.fullmatch(r"Object contains unknown field `(.*)`", what):
        known = ["kind", *kind.__struct_fields__] if kind else ["faults"]
        return f"unknown key '{unknown[1]}' in {place}; the keys there are {', '.join(known)}"
    if missing := re.fullmatch(r"Object missing required field `(.*)`", what):
        choices = f", one of {', '.join(kinds)}" if missing[1] == "kind" else ""
        return f"{place}.{missing[1]} is missing; add it{choices}"
    if value := re.fullmatch(r"Invalid value '(.*)'", what):
        return f"{place} is '{value[1]}'; choose one of {', '.join(kinds)}"
    if wrong := misfit(what):
        return f"{place} {wrong}"
    if what.startswith("Expected `array` of length >="):
        return f"{place} is empty; name at least one peer"
    if what.startswith("Expected `str` matching regex"):
        return f"{place} cannot be a peer's name; use one on the roster, such as base, agent, robot1"
    return f"{place} does not fit: {what[:1].lower()}{what[1:]}; docs/faults.md shows every kind"

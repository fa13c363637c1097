"""A scenario file: one TOML file that says which team does what, where. Every fault is one sentence.

This module reads the file and checks what can be checked without the map; :mod:`launcher.preparation` holds it against
the map and makes the :class:`~agents.mission.Mission`.
"""

from __future__ import annotations

import difflib
import errno
import math
import re
import stat
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal, get_type_hints

import msgspec
from msgspec import Meta

import maps
from launcher.fault_timetable import Fault, FaultyTimetable, timetable_of
from launcher.wording import counted, misfit
from protocol.keys import is_name
from protocol.messages import Point

_PACKAGED = Path(__file__).parent / "scenarios"

Metres = Annotated[float, Meta(gt=0, le=100)]
Speed = Annotated[float, Meta(gt=0, le=100)]
Rate = Annotated[float, Meta(ge=0.1, le=100)]
Pause = Annotated[float, Meta(ge=0, le=86400)]
Duration = Annotated[float, Meta(gt=0, le=86400)]

MOST_ROBOTS = 40
"""Every peer holds a connection to every other, which is good for about so many."""


class ScenarioFault(ValueError):
    """A scenario that cannot be run; the text says file, place and remedy in one sentence."""


class _Table(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of the file; unknown keys are faults."""


class Base(_Table, frozen=True, kw_only=True):
    """``[base]``: the base station, a post that stands still and takes no room: robots and agent may stand on it."""

    position: Point


class Agent(_Table, frozen=True, kw_only=True):
    """``[agent]``: the tracked agent and how it walks."""

    start: Point
    behaviour: Literal["script", "wander", "goals"] = "wander"
    """``script``: the ``goals`` in order; ``wander``: it explores; ``goals``: it waits for ``sightline goal``."""
    goals: tuple[Point, ...] = ()
    pause_s: Pause = 2.0
    start_after_s: Pause = 3.0
    around_corner_share: Annotated[float, Meta(ge=0, le=1)] = 0.5
    announces: bool = True
    """Whether it says where it is and goes; else it answers ranging, and nothing more."""
    speed_m_s: Speed = 0.5
    radius_m: Metres = 0.2


class Robots(_Table, frozen=True, kw_only=True):
    """``[robots]``: either ``count``, and they start around the base station, or their ``starts``."""

    count: Annotated[int, Meta(ge=1, le=MOST_ROBOTS)] | None = None
    starts: tuple[Point, ...] = ()
    speed_m_s: Speed = 1.0
    radius_m: Metres = 0.2


class Rates(_Table, frozen=True, kw_only=True):
    """``[rates]``: control loop (and state messages), heartbeats."""

    control_hz: Rate = 10.0
    heartbeat_hz: Rate = 2.0


class Planning(_Table, frozen=True, kw_only=True):
    """``[planning]``: how the leader plans."""

    placements: Literal["cells", "points"] = "points"
    """``cells``: relays stand in cells that wholly see each other; ``points``: at corners and on a grid."""
    spacing_m: Metres | None = None
    """Of the grid of points; without it one that suits the map."""
    decomposition: Literal["inflection", "aspect"] = "inflection"
    """Kind of cells."""
    search: Literal["chain", "exact", "one-edge", "fixed"] = "chain"
    """How the leader finds chains."""
    topology: Literal["optimum", "auction"] = "optimum"
    """Who looks for the next tree: the leader alone, or all by bids for one link of it."""
    retreat_after_s: Annotated[float, Meta(ge=5, le=86400)] = 10.0
    """Robots that nobody has led for so long go back the way that they have come, all together or none."""
    period_s: Annotated[float, Meta(ge=0.05, le=86400)] = 0.5


class Ranging(_Table, frozen=True, kw_only=True):
    """``[ranging]``: how robots and base station measure their distance to the agent."""

    rate_hz: Annotated[float, Meta(ge=0.1, le=20)] = 4.0
    bound_m: Annotated[float, Meta(ge=0, le=100)] = 0.2
    """No range is wrong by more."""
    noise_m: Annotated[float, Meta(ge=0, le=100)] | None = None
    """What ranges are really wrong by, at most; half of ``bound_m`` if not given."""
    clock_bound_s: Annotated[float, Meta(ge=0, le=1)] = 0.05
    """The most by which the clocks of any two peers differ."""


class Network(_Table, frozen=True, kw_only=True):
    """``[network]``: peer i listens on 127.0.0.1, port ``base_port + i``; without it, on free ports."""

    base_port: Annotated[int, Meta(ge=1024, le=65000)] | None = None


class Scenario(_Table, frozen=True, kw_only=True):
    """The whole file."""

    map: str
    """A packaged map by its name, or a map file relative to the scenario file."""
    base: Base
    agent: Agent
    robots: Robots
    map_tolerance_m: Metres | None = None
    """How far from a wall the outline of an occupancy grid may be cut short; two cells of the grid if not given."""
    name: str = ""
    """Name of team and run; the file's name when it is not given."""
    duration_s: Duration | None = None
    """Without it the run lasts until Ctrl-C."""
    seed: Annotated[int, Meta(ge=0, le=2**53)] = 0
    rates: Rates = Rates()
    planning: Planning = Planning()
    ranging: Ranging = Ranging()
    network: Network = Network()
    faults: tuple[Fault, ...] = ()
    """``[[faults]]``: what goes wrong on purpose, as in a timetable (:mod:`launcher.fault_timetable`)."""

    @property
    def robot_count(self) -> int:
        """How many robots the team has."""
        return self.robots.count if self.robots.count is not None else len(self.robots.starts)


_EXAMPLES = {
    "map": 'map = "office"',
    "base": "[base] with position = [2.0, 3.0]",
    "base.position": "position = [2.0, 3.0]",
    "agent": "[agent] with start = [3.0, 3.0]",
    "agent.start": "start = [3.0, 3.0]",
    "robots": "[robots] with count = 4",
}


def packaged() -> list[str]:
    """Names of the scenarios that come with Sightline."""
    return sorted(file.stem for file in _PACKAGED.glob("*.toml"))


def find_scenario(name_or_path: str) -> Path:
    """File of a packaged scenario, or the path itself.

    Raises:
        ScenarioFault: there is neither a file nor a packaged scenario of this name.
    """
    path = Path(name_or_path)
    if stat.S_ISREG(_mode(path)):
        return path
    if name_or_path in packaged():
        return _PACKAGED / f"{name_or_path}.toml"
    if stat.S_ISDIR(_mode(path)):
        raise ScenarioFault(f"{name_or_path} is a folder: name the scenario file (.toml) in it")
    near = difflib.get_close_matches(name_or_path, packaged(), n=1)
    hint = f"did you mean '{near[0]}'" if near else f"give a TOML file or one of {', '.join(packaged())}"
    raise ScenarioFault(f"no scenario {name_or_path}: {hint}")


def _mode(path: Path) -> int:
    """What :mod:`stat` tells kinds of files by; 0 if there is nothing, nor can be: a name too long, or with a NUL."""
    try:
        return path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError, ValueError):
        return 0
    except OSError as problem:
        if problem.errno == errno.ENAMETOOLONG:
            return 0
        raise


def find_map(name_or_path: str, folder: Path, place: str = "") -> Path:
    """File of a packaged map, or of a map file relative to ``folder``; ``place`` says who asks, for the fault.

    Raises:
        ScenarioFault: there is neither.
    """
    if name_or_path in maps.names():
        return maps.path(name_or_path)
    path = folder / name_or_path
    if stat.S_ISREG(_mode(path)):
        return path
    near = difflib.get_close_matches(name_or_path, maps.names(), n=1)
    hint = f"did you mean '{near[0]}'" if near else f"give a map file or one of {', '.join(maps.names())}"
    if stat.S_ISDIR(_mode(path)):
        hint = "that is a folder, name the map file in it"
    raise ScenarioFault(f"{place}no map {name_or_path}: {hint}")


def read_scenario(path: Path) -> Scenario:
    """Scenario of a file, complete in itself, not yet held against the map.

    Raises:
        ScenarioFault: the file cannot be read, is no TOML, has a key or value that does not fit, or contradicts itself.
    """
    try:
        raw = tomllib.loads(path.read_text(encoding="utf-8"))
        for place, number in _numbers(raw, ""):
            if not math.isfinite(number):
                raise ScenarioFault(f"{path}: {place} is {number}; give a finite number")
        timetable_of({"faults": raw.get("faults", [])})  # says what is wrong with a fault
        scenario = msgspec.convert(raw, Scenario)
    except OSError as problem:
        raise ScenarioFault(f"{path}: cannot be read ({problem.strerror}); give the path of a TOML file") from problem
    except UnicodeDecodeError as problem:
        raise ScenarioFault(f"{path}: is not text in UTF-8; save the scenario as UTF-8") from problem
    except tomllib.TOMLDecodeError as problem:
        said = str(problem)
        raise ScenarioFault(f"{path}: is not valid TOML, {said[:1].lower()}{said[1:]}; mend that line") from problem
    except msgspec.ValidationError as problem:
        raise ScenarioFault(f"{path}: {_explain(str(problem))}") from problem
    except RecursionError as problem:
        raise ScenarioFault(f"{path}: is nested too deeply; a place is [x, y], and nothing is deeper") from problem
    except FaultyTimetable as problem:
        raise ScenarioFault(f"{path}: {problem}") from problem
    except ScenarioFault:
        raise
    except ValueError as problem:  # the interpreter reads whole numbers of at most 4300 digits
        raise ScenarioFault(f"{path}: holds a number of thousands of digits; give metres and seconds") from problem
    fault = _contradiction(scenario)
    if fault:
        raise ScenarioFault(f"{path}: {fault}")
    return scenario if scenario.name else msgspec.structs.replace(scenario, name=_name_of(path))


def _name_of(path: Path) -> str:
    """A name from the file's: lower case, underscores, a letter first."""
    name = re.sub(r"[^a-z0-9_]+", "_", path.stem.lower())[:32]
    return name if is_name(name) else f"run_{name}"[:32]


def _contradiction(scenario: Scenario) -> str:
    """What contradicts itself, as a sentence; empty if nothing does."""
    agent, robots = scenario.agent, scenario.robots
    if scenario.name and not is_name(scenario.name):
        return (
            f"name '{scenario.name}' cannot name a team; "
            "use at most 32 of a-z, 0-9 and _, a letter first, and not 'operator'"
        )
    if agent.behaviour == "script" and not agent.goals:
        return "agent.behaviour is 'script' and there are no goals; add goals = [[x, y], ...] to [agent]"
    if agent.behaviour != "script" and agent.goals:
        return (
            f"agent.goals are given and agent.behaviour is '{agent.behaviour}'; "
            'set behaviour = "script" in [agent], or remove the goals'
        )
    if robots.count is None and not robots.starts:
        return "[robots] says neither count nor starts; add count = 4, or starts = [[x, y], ...]"
    if robots.count is not None and robots.starts and robots.count != len(robots.starts):
        return (
            f"robots.count is {robots.count} and robots.starts has {counted(len(robots.starts), 'place')}; "
            "remove one of the two"
        )
    if len(robots.starts) > MOST_ROBOTS:
        return f"robots.starts has {len(robots.starts)} places; a team has at most {MOST_ROBOTS} robots"
    ranging = scenario.ranging
    if ranging.noise_m is not None and ranging.noise_m > ranging.bound_m:
        return (
            f"ranging.noise_m ({ranging.noise_m:g}) is more than ranging.bound_m ({ranging.bound_m:g}), and the "
            "estimate would lose the agent; make bound_m at least as large"
        )
    planning = scenario.planning
    if planning.topology == "auction" and planning.search in ("exact", "fixed"):
        return (
            f"planning.topology is 'auction' and planning.search is '{planning.search}'; bids are for trees one edge "
            "away from the team's, remove search"
        )
    if planning.spacing_m is not None and planning.placements == "cells":
        return "planning.spacing_m is given and planning.placements is 'cells'; only points are on a grid, remove one"
    return ""


def _numbers(value: Any, place: str) -> Iterator[tuple[str, float]]:
    """Every float of a decoded file with its place."""
    if isinstance(value, float):
        yield place, value
    elif isinstance(value, dict):
        for key, item in value.items():
            yield from _numbers(item, f"{place}.{key}" if place else key)
    elif isinstance(value, list):
        for index, item in enumerate(value):
            yield from _numbers(item, f"{place}[{index}]")


def _explain(message: str) -> str:
    """A sentence with place and remedy for what msgspec says of a value that does not fit."""
    what, _, where = message.partition(" - at `$")
    place = where.rstrip("`").lstrip(".")
    if unknown := re.fullmatch(r"Object contains unknown field `(.*)`", what):
        return _unknown_key(unknown[1], place)
    if missing := re.fullmatch(r"Object missing required field `(.*)`", what):
        key = f"{place}.{missing[1]}" if place else missing[1]
        return f"{key} is missing; add {_EXAMPLES[key]}"
    if wrong := misfit(what):
        return f"{place} {wrong}{'' if 'out of range' in wrong else _like(place)}"
    if length := re.fullmatch(r"Expected `array` of length 2, got (\d+)", what):
        return f"{place} has {counted(int(length[1]), 'number')}; a place is [x, y] in metres"
    if enum := re.fullmatch(r"Invalid enum value '(.*)'", what):
        choices = _choices(place)
        near = difflib.get_close_matches(enum[1], choices, n=1)
        hint = f"did you mean '{near[0]}'" if near else f"choose one of {', '.join(choices)}"
        return f"{place} is '{enum[1]}'; {hint}"
    return f"{place or 'the file'} does not fit: {what[:1].lower()}{what[1:]}"


def _like(place: str) -> str:
    """An example for a place or a list of places."""
    if place.endswith(("position", "start", "]")):
        return ", a place is [x, y] in metres"
    return ", like [[x, y], [x, y]]" if place.endswith(("goals", "starts")) else ""


def _table_at(place: str) -> type[msgspec.Struct]:
    """Struct of the table at a place."""
    table: type[msgspec.Struct] = Scenario
    for key in filter(None, place.split(".")):
        table = get_type_hints(table)[key]
    return table


def _choices(place: str) -> list[str]:
    """What a key with fixed choices may be."""
    table, _, key = place.rpartition(".")
    return list(get_type_hints(_table_at(table))[key].__args__)


def _unknown_key(key: str, place: str) -> str:
    """A sentence for a key that is not known: the near one, or one of another table, or all there are."""
    known = list(_table_at(place).__struct_fields__)
    title = f"in [{place}]" if place else "at the top of the file"
    near = difflib.get_close_matches(key, known, n=1)
    if near:
        return f"unknown key '{key}' {title}; did you mean '{near[0]}'"
    if not place:
        homes = [name for name in known if key in getattr(get_type_hints(Scenario)[name], "__struct_fields__", ())]
        if homes:
            return f"unknown key '{key}' at the top of the file; it belongs in [{homes[0]}]"
    return f"unknown key '{key}' {title}; the keys there are {', '.join(known)}"

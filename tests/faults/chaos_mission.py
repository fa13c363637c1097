"""Missions in which much goes wrong, drawn from a seed."""

from __future__ import annotations

from collections.abc import Sequence
from random import Random
from typing import Final, Literal

import msgspec

from agents.mission import Mission, Ranging, RosterEntry, Scripted
from launcher.fault_timetable import (
    LEADER,
    Clock,
    Corrupt,
    Cut,
    Delay,
    Disk,
    Duplicate,
    Fault,
    Kill,
    Loss,
    Partition,
    Pause,
    Timetable,
    write_timetable,
)
from protocol.ballot import CLOCK_DRIFT
from tests.faults.light_team import DEPTH_M, RADIUS_M, WIDTH_M, lane

QUIET_S: Final = 8.0
"""At the end of each mission nothing goes wrong any more, for so long."""

LONGEST_FAULT_S: Final = 6.0

RETREATS_AFTER_S: Final = (5.0, 10.0, 86400.0)
"""Robots go back after so long without a leader; the last of these is never."""

BLEEDINGS: Final = 0.2
"""Share of the missions in which so many voters die early that with one more there is no majority, and then one more
does for long: what is left of the team may go back."""

LEAST_BLEEDING_S: Final = 28.0
"""In shorter missions nobody would have the time to go back."""

BLACKOUTS: Final = 0.04
"""Share of the occasions on which all voters, or most of them, are killed at about the same time."""


SIZES: Final = (56, 22, 11, 6, 5)
"""How often teams have the least number of robots, one more, and so on: what breaks a rule breaks it in small teams
too, mostly, and of these many can be looked at."""

MORE_S: Final = 4.0
"""By so much missions are longer, on average, than the shortest."""

PLANNING_PERIODS_S: Final = (0.5, 1.0, 2.0)

RANGING: Final = Ranging(noise_m=Ranging().bound_m)
"""Ranges are as wrong as they may be."""


class ChaosCase(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A mission and what goes wrong in it; the same case has the same history, to the last bit."""

    seed: int
    """Of the mission, and of all that is left to chance in it."""
    robots: int
    duration_s: float
    ends_s: float | None = None
    """When it is broken off; the end if not given."""
    announces: bool = True
    """Whether the agent does."""
    retreat_after_s: float = 10.0
    """When robots that nobody leads go back."""
    planning_period_s: float = 1.0
    """How often the leader plans anew."""
    map: str = ""
    """A packaged map, with the full planner; none: the open room, with the light one."""
    faults: tuple[Fault, ...] = ()

    @property
    def timetable(self) -> Timetable:
        """What goes wrong."""
        return Timetable(faults=self.faults)

    def mission(self) -> Mission:
        """What all peers know, in the open room."""
        chance = Random(f"{self.seed}/mission")
        goals = tuple(
            (round(chance.uniform(2.0, WIDTH_M - 1.0), 2), DEPTH_M - 1.0) for _ in range(int(self.duration_s / 8.0) + 1)
        )
        return Mission(
            team="team",
            map_path="",
            roster=(
                RosterEntry(name="base", role="base_station", start=(1.0, DEPTH_M / 2 + 4.5)),
                RosterEntry(name="agent", role="tracked_agent", start=(3.0, DEPTH_M - 1.0)),
                *(
                    RosterEntry(name=name, role="robot", start=lane(n))
                    for n, name in enumerate(robot_names(self.robots))
                ),
            ),
            behaviour=Scripted(goals=goals, pause_s=1.0, start_after_s=2.0),
            robot_radius_m=RADIUS_M,
            agent_radius_m=RADIUS_M,
            robot_speed_m_s=1.2,
            agent_speed_m_s=0.8,
            control_hz=2.0,
            heartbeat_hz=1.0,
            planning_period_s=self.planning_period_s,
            decomposition="inflection",
            duration_s=self.duration_s,
            seed=self.seed,
            announces=self.announces,
            retreat_after_s=self.retreat_after_s,
            ranging=RANGING,
            epoch_unix_s=0.0,
            planning_delay_s=round(chance.choice((0.0, 0.02, 0.1, 0.3)), 3),
        )


def robot_names(count: int) -> tuple[str, ...]:
    """Of a team with so many robots."""
    return tuple(f"robot{number}" for number in range(1, count + 1))


def draw_case(
    seed: int, robots: tuple[int, int] = (3, 7), duration_s: tuple[int, int] = (30, 60), *, clocks: bool = True
) -> ChaosCase:
    """A mission with faults of all kinds, several of them at a time.

    Args:
        seed: of everything.
        robots: least and greatest number of them, at most five sizes; base station and agent come on top.
        duration_s: least and greatest, seconds.
        clocks: whether they may differ by more than those can that share an estimate.
    """
    chance = Random(f"{seed}/case")
    sizes = range(robots[0], robots[1] + 1)
    (count,) = chance.choices(sizes, SIZES[: len(sizes)])
    ends_s = float(min(duration_s[0] + int(chance.expovariate(1.0 / MORE_S)), duration_s[1]))
    retreat_after_s, planning_period_s = chance.choice(RETREATS_AFTER_S), chance.choice(PLANNING_PERIODS_S)
    voters = ("base", *robot_names(count))
    loses_disks = chance.random() < 0.15
    faults: list[Fault] = []
    if chance.random() < 0.5:
        faults += draw_clocks(chance, voters) if clocks else draw_close_clocks(chance, voters)
    bleeds = draw_bleeding(chance, voters, ends_s) if chance.random() < BLEEDINGS and ends_s >= LEAST_BLEEDING_S else []
    begins_s = 0.0
    while True:
        begins_s += chance.expovariate(1.0 / chance.choice((0.3, 2.5)))
        for_s = _round(min(chance.expovariate(0.5) + 0.05, LONGEST_FAULT_S, ends_s - QUIET_S - begins_s))
        if for_s < 0.05:
            break
        if chance.random() < BLACKOUTS:
            faults += draw_blackout(chance, voters, begins_s, for_s)
        else:
            faults.append(draw_fault(chance, voters, _round(begins_s), for_s, loses_disks=loses_disks))
    if chance.random() < 0.1:
        faults.append(Kill(at_s=_round(chance.uniform(3.0, ends_s - QUIET_S)), who=chance.choice(voters)))
    if bleeds:  # whoever else died or hung then would keep all others from going back
        faults = [fault for fault in faults if not isinstance(fault, Kill | Pause)]
    faults = sorted(faults + bleeds, key=lambda fault: fault.at_s)
    return ChaosCase(
        seed=seed, robots=count, duration_s=ends_s, retreat_after_s=retreat_after_s,
        planning_period_s=planning_period_s, faults=tuple(faults),
    )  # fmt: skip


def draw_ranged_case(seed: int, robots: tuple[int, int] = (3, 7), duration_s: tuple[int, int] = (30, 60)) -> ChaosCase:
    """The same with an agent that tells nobody where it is: ranges, and an estimate that all share."""
    return msgspec.structs.replace(draw_case(seed, robots, duration_s, clocks=False), announces=False)


def draw_clocks(chance: Random, voters: Sequence[str]) -> list[Fault]:
    """Clocks of other zeros, and of rates up to the limits that the election allows."""
    rates = (1.0 - CLOCK_DRIFT, 1.0, 1.0 + CLOCK_DRIFT)
    return [
        Clock(at_s=0.0, who=name, rate=chance.choice(rates), offset_s=_round(chance.uniform(-50.0, 50.0)))
        for name in voters
    ]


def draw_close_clocks(chance: Random, voters: Sequence[str]) -> list[Fault]:
    """Clocks as far apart as those may be that share an estimate."""
    bound_s = RANGING.clock_bound_s
    return [
        Clock(at_s=0.0, who=name, offset_s=_round(chance.choice((-0.5 * bound_s, 0.0, 0.5 * bound_s))))
        for name in voters
    ]


def draw_bleeding(chance: Random, voters: Sequence[str], ends_s: float) -> list[Fault]:
    """So many robots die early that with the next one, the base station, there is no majority for a while."""
    minority = (len(voters) - 1) // 2
    next_s = _round(chance.uniform(10.0, 14.0))
    dead = chance.sample(voters[1:], minority)
    return [
        *(Kill(at_s=_round(chance.uniform(2.0, 4.0)), who=name) for name in dead),
        Kill(at_s=next_s, for_s=_round(ends_s - QUIET_S - next_s - chance.uniform(0.0, 4.0)), who=voters[0]),
    ]


def draw_blackout(chance: Random, voters: Sequence[str], at_s: float, for_s: float) -> list[Fault]:
    """The power fails: what is not on disk is forgotten."""
    spared = chance.choice((0, 0, 1))
    return [
        Kill(at_s=_round(at_s + chance.uniform(0.0, 0.02)), for_s=_round(for_s * chance.uniform(0.5, 1.0)), who=name)
        for name in chance.sample(voters, len(voters) - spared)
    ]


def draw_fault(chance: Random, voters: Sequence[str], at_s: float, for_s: float, *, loses_disks: bool = False) -> Fault:
    """One fault of any kind."""
    who = LEADER if chance.random() < 0.4 else chance.choice((*voters, "agent"))
    some = tuple(chance.sample(voters, chance.randint(1, len(voters) - 1)))
    speakers = () if chance.random() < 0.3 else some
    hearers = () if chance.random() < 0.3 else tuple(chance.sample(voters, chance.randint(1, len(voters) - 1)))
    share = _round(chance.choice((0.1, 0.3, 0.6)))
    match chance.choices(_KINDS, _WEIGHTS)[0]:
        case "kill":
            disk: Literal["kept", "lost"] = "lost" if loses_disks and chance.random() < 0.5 else "kept"
            late_s = chance.choice((0.0, 0.0, 1.0, 3600.0))
            return Kill(at_s=at_s, for_s=for_s, who=who, disk=disk, noticed_after_s=late_s)
        case "pause":
            return Pause(at_s=at_s, for_s=for_s, who=who, speaking=chance.random() < 0.5)
        case "partition":
            return Partition(at_s=at_s, for_s=for_s, group=some, noticed_after_s=chance.choice((0.0, 1.0, 3600.0)))
        case "cut":
            return Cut(at_s=at_s, for_s=for_s, speakers=some, hearers=hearers)
        case "loss":
            burst = chance.choice((1.0, 1.0, 5.0, 20.0))
            return Loss(at_s=at_s, for_s=for_s, speakers=speakers, hearers=hearers, share=share, burst=burst)
        case "delay":
            tails: tuple[Literal["uniform", "exponential", "log-normal"], ...] = (
                "uniform",
                "exponential",
                "log-normal",
            )
            mean_s = chance.choice((0.01, 0.1, 0.5, 1.5))
            spikes, spike_s = chance.choice(((0.0, 0.0), (0.05, 1.0), (0.2, 3.0)))
            return Delay(
                at_s=at_s, for_s=for_s, speakers=speakers, hearers=hearers, mean_s=mean_s, tail=chance.choice(tails),
                spikes=spikes, spike_s=spike_s, overtaking=chance.random() < 0.5,
            )  # fmt: skip
        case "duplicate":
            return Duplicate(at_s=at_s, for_s=for_s, speakers=speakers, hearers=hearers, share=share)
        case "corrupt":
            return Corrupt(at_s=at_s, for_s=for_s, speakers=speakers, hearers=hearers, share=share)
    if chance.random() < 0.3:
        return Disk(at_s=at_s, for_s=for_s, who=who, full=True)
    return Disk(at_s=at_s, for_s=for_s, who=who, takes_s=chance.choice((0.05, 0.3, 1.5)))


_KINDS: Final = ("kill", "pause", "partition", "cut", "loss", "delay", "duplicate", "corrupt", "disk")
_WEIGHTS: Final = (6, 6, 4, 3, 3, 3, 1, 1, 3)


def _round(number: float) -> float:
    """To milliseconds, so that timetables can be read."""
    return round(number, 3)


def write_case(case: ChaosCase) -> str:
    """TOML text of a case, which :func:`read_case` reads."""
    lines = [f"seed = {case.seed}", f"robots = {case.robots}", f"duration_s = {case.duration_s}"]
    if case.ends_s is not None:
        lines.append(f"ends_s = {case.ends_s}")
    if not case.announces:
        lines.append("announces = false")
    lines += [f"retreat_after_s = {case.retreat_after_s}", f"planning_period_s = {case.planning_period_s}"]
    if case.map:
        lines.append(f'map = "{case.map}"')
    return "\n".join(lines) + "\n\n" + write_timetable(case.timetable)


def read_case(text: str) -> ChaosCase:
    """Case of a TOML text."""
    return msgspec.toml.decode(text, type=ChaosCase)

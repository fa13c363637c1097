"""Campaign: the election of three voters explored further than the tests do, and teams under random faults.

    python -m tests.campaigns.election --missions 1000 --states 3000000

The exploration stops at the number of states given for each of its bounds, and says so. It ends with status 1 if a rule
was broken, or a team had no leader whom all obey within three leases after its last fault, and prints history or seed.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import time
from dataclasses import replace
from random import Random

from protocol.election import LEASE_S
from tests.protocol.election_exploration import Bounds, Exploration, TooLarge
from tests.protocol.election_mutants import DISKS_ARE_SLOW, FAST, ONE_DIES, ONE_OBEYS, SLOW, TWO_STAND
from tests.protocol.election_team import Team

FAULTS = 25
"""Of every mission."""


def bounds_to_explore() -> dict[str, Bounds]:
    """What is explored, by name."""
    clocks = itertools.product((SLOW, FAST), (SLOW, FAST), (SLOW, FAST))
    everywhere = {f"any two stand, clocks {rates}": Bounds(steps=3, candidacies=2, rates=rates) for rates in clocks}
    return everywhere | {
        "two stand, four steps in a lease": replace(TWO_STAND, steps=5, steps_in_lease=4, refusals=True),
        "three candidacies, two rounds": replace(TWO_STAND, candidacies=3, rounds=(2, 2, 0)),
        "slow disks, one dies": DISKS_ARE_SLOW,
        "two die, with or without disk": replace(ONE_DIES, crashes=2, lose_disks=True),
        "any two stand, two die": Bounds(steps=2, candidacies=2, crashes=2, refusals=False, rates=(SLOW, FAST, FAST)),
        "one obeys, one dies": replace(ONE_OBEYS, crashes=1, lose_disks=True),
        "two obey": replace(ONE_OBEYS, heeding=("base", "robot2")),
    }


def explore(most_states: int) -> int:
    """Print what came of each exploration; how many found something."""
    broken = 0
    for name, bounds in bounds_to_explore().items():
        began = time.perf_counter()
        exploration = Exploration(bounds)
        try:
            exploration.run(most_states)
            end = "all"
        except TooLarge:
            end = "the nearest"
        found, states = exploration.explored.found, exploration.explored.states
        print(f"{name}: {end} {states:,} states in {time.perf_counter() - began:.0f} s", flush=True)
        if found is not None:
            broken += 1
            print("  BROKEN: " + "\n  ".join((found.rule, *found.history)))
    return broken


def mission(seed: int) -> float | None:
    """Put a team through faults; how long it took after the last one until one leads and all obey, None: too long."""
    chance = Random(f"{seed}/faults")
    team = Team(chance.choice((2, 3, 4, 5, 7)), seed)
    names = list(team.peers)
    for _ in range(FAULTS):
        team.run(chance.uniform(0.0, 1.2))
        name = chance.choice(names)
        match chance.choice(
            ("kill", "lose", "start", "start", "pause", "resume", "heal", "loss", "part", "cut", "slow")
        ):
            case "kill":
                team.kill(name)
            case "lose":
                team.kill(name, lose_disk=True)
            case "start":
                team.start(name)
            case "pause":
                team.pause(name)
            case "resume":
                team.resume(name)
            case "heal":
                team.heal()
            case "loss":
                team.loss = chance.choice((0.0, 0.3, 0.6))
            case "part":
                team.part(chance.sample(names, chance.randrange(1, len(names))))
            case "cut":
                team.cut.add((name, chance.choice(names)))
            case "slow":
                team.delay_s = chance.choice(((0.0, 0.01), (0.05, 0.4), (0.0, 2.5)))
                team.disk_s = chance.choice(((0.0, 0.01), (0.0, 1.5)))
    team.run(chance.uniform(0.0, 0.5))
    team.heal()
    healed_s = team.time.now_s
    while team.time.now_s < healed_s + 3.0 * LEASE_S:
        team.run(0.02)
        if team.leaders() and all(team.obeys(name) is not None for name in names):
            return team.time.now_s - healed_s
    return None


def main() -> int:
    """Explore, run the missions, print the times; 1 if anything broke."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--missions", type=int, default=1000)
    parser.add_argument("--states", type=int, default=1_000_000, help="per exploration; 0: explore nothing")
    parser.add_argument("--seed", type=int, default=0, help="of the first mission")
    options = parser.parse_args()
    broken = explore(options.states) if options.states else 0
    took = []
    shown = time.monotonic()
    for seed in range(options.seed, options.seed + options.missions):
        try:
            settled_s = mission(seed)
        except AssertionError as problem:
            broken += 1
            print(f"seed {seed}: BROKEN: {problem}")
            continue
        if settled_s is None:
            broken += 1
            print(f"seed {seed}: no leader whom all obey within three leases")
        else:
            took.append(settled_s)
        if time.monotonic() - shown > 5.0:
            shown = time.monotonic()
            print(f"{seed + 1 - options.seed} of {options.missions} missions", file=sys.stderr)
    if took:
        took.sort()
        text = f"median {took[len(took) // 2]:.2f} s, 99 % {took[int(0.99 * len(took))]:.2f} s, worst {took[-1]:.2f} s"
        print(f"{len(took)} missions of {FAULTS} faults: a leader whom all obey after {text}")
    print(f"{broken} broken")
    return int(broken > 0)


if __name__ == "__main__":
    sys.exit(main())

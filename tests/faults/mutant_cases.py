"""A short mission for each rule left out, in which that leads to harm, and which rule is then broken."""

from __future__ import annotations

from typing import Final

from launcher.fault_timetable import Clock, Cut, Delay, Disk, Fault, Kill, Partition, Pause
from tests.faults.chaos_mission import ChaosCase


def _case(
    ends_s: float,
    *faults: Fault,
    robots: int = 2,
    seed: int = 1,
    duration_s: float = 30.0,
    announces: bool = True,
    retreat_after_s: float = 10.0,
) -> ChaosCase:
    return ChaosCase(
        seed=seed, robots=robots, duration_s=duration_s, ends_s=ends_s, announces=announces,
        retreat_after_s=retreat_after_s, faults=faults,
    )  # fmt: skip


VOTERS = ("base", "robot1", "robot2")

BLACKOUT: Final = tuple(Kill(at_s=4.0, for_s=1.0, who=name) for name in VOTERS)
"""All die at once, and begin again."""

INSIDE: Final = "the agent is inside every set"

OLD_VOTES: Final = (
    Delay(at_s=3.0, hearers=("base",), least_s=0.6, mean_s=0.0),
    Cut(at_s=5.0, speakers=("base",)),
)
"""Votes take long to the base station, which is then not heard any more: so the votes that come are old."""

DEAF: Final = Cut(at_s=3.0, for_s=9.0, hearers=("robot1",))
"""It hears nothing more, and is heard."""

LATE: Final = Delay(at_s=2.0, speakers=("base",), hearers=("robot1",), least_s=1.5, mean_s=0.0)
"""All that the leader says is old when it arrives at one of its robots."""

CASES: Final[dict[str, tuple[str, ChaosCase]]] = {
    "skips_the_write": ("epochs rise", _case(8.0, *BLACKOUT)),
    "says_before_it_is_written": (
        "epochs rise",
        _case(
            12.0,
            *(Disk(at_s=0.0, who=name, takes_s=3.0, full=True) for name in VOTERS),
            *(Kill(at_s=1.3 + 2.0 * time, for_s=0.2, who=name) for time in range(5) for name in VOTERS),
        ),
    ),
    "does_not_write_its_own_vote": (
        "epochs rise",
        _case(
            8.0,
            Partition(at_s=0.0, for_s=5.0, group=("robot2",)),
            Kill(at_s=4.0, who="robot1"),
            Kill(at_s=4.5, for_s=0.3, who="base"),
        ),
    ),
    "ignores_the_epoch": (
        "epochs rise",
        _case(  # robot1 has not heard of any epoch, and robot2, which has, hangs until its promise has ended
            8.0,
            Partition(at_s=0.0, for_s=4.5, group=("robot1",)),
            Kill(at_s=4.0, who="base"),
            Pause(at_s=4.0, for_s=1.5, who="robot2"),
        ),
    ),
    "ignores_its_promise": (
        "one leads",
        _case(
            8.0,
            Cut(at_s=3.0, speakers=("base",), hearers=("robot2",)),
            Cut(at_s=3.0, speakers=("robot2",), hearers=("base",)),
        ),
    ),
    "votes_at_once_after_a_restart": (
        "one leads",
        _case(
            8.0,
            Cut(at_s=3.0, speakers=("base",), hearers=("robot2",)),
            Cut(at_s=3.0, speakers=("robot2",), hearers=("base",)),
            *(Kill(at_s=5.0 + 0.4 * n, for_s=0.05, who="robot1") for n in range(6)),
        ),
    ),
    "counts_the_lease_from_the_reply": ("one leads", _case(8.0, *OLD_VOTES)),
    "counts_votes_of_any_round": ("one leads", _case(8.0, *OLD_VOTES)),
    "is_elected_by_a_minority": ("one leads", _case(8.0, Partition(at_s=3.0, group=("base",)))),
    "leads_on_when_its_lease_has_ended": (
        "one leads",
        _case(8.0, Partition(at_s=3.0, group=("base",))),
    ),
    "gives_orders_after_its_lease": (
        "orders are given within a lease",
        _case(8.0, Partition(at_s=3.0, group=("base",))),
    ),
    "obeys_after_the_lease": (
        "who obeys obeys who leads",
        _case(8.0, DEAF, Kill(at_s=3.0, who="base"), robots=4),
    ),
    "obeys_without_a_warrant": ("no order is taken when its lease has ended", _case(8.0, LATE)),
    "judges_validity_on_arrival": ("no order is taken when its lease has ended", _case(8.0, LATE)),
    "takes_any_word_on_the_tree": ("no order is taken when its lease has ended", _case(8.0, LATE)),
    "ignores_the_sequence": (
        "no older order after a newer one",
        _case(8.0, Delay(at_s=1.0, mean_s=0.1, overtaking=True)),
    ),
    "takes_words_on_the_tree_as_they_come": (
        "no older order after a newer one",
        _case(8.0, Delay(at_s=1.0, mean_s=0.1, overtaking=True)),
    ),
    "drives_on_when_it_obeys_nobody": (
        "nobody moves who obeys nobody",
        _case(14.0, *(Kill(at_s=at_s, who=name) for at_s, name in ((7.5, "base"), (7.5, "robot2")))),
    ),
    "begins_two_stages_ahead": ("nobody is two stages ahead", _case(24.0, robots=3)),
    "goes_beyond_what_is_released": ("nobody goes beyond what is released", _case(12.0, robots=3)),
    "releases_before_all_have_accepted": (
        "nothing is released before all have accepted it",
        _case(
            20.0,
            *(Cut(at_s=3.0 + 1.6 * time, for_s=0.8, speakers=("base",), hearers=("robot1",)) for time in range(10)),
            robots=3,
        ),
    ),
    "goes_back_on_its_own": (
        "nobody goes back before all have turned",
        _case(16.0, *(Kill(at_s=7.5, who=name) for name in ("base", "robot2")), retreat_after_s=5.0),
    ),
    "goes_back_as_fast_as_it_can": (
        "nobody goes back ahead of those who are farther",
        _case(
            30.0,
            *(Kill(at_s=2.0, who=name) for name in ("robot3", "robot4")),
            Kill(at_s=20.0, who="base"),
            robots=4,
            duration_s=40.0,
            retreat_after_s=5.0,
        ),
    ),
    "releases_links_first": ("links are released when their replacement is confirmed", _case(4.0)),
    "trusts_its_predecessor": (
        "links are released when their replacement is confirmed",
        _case(22.0, *(Kill(at_s=15.0, who=name) for name in ("base", "robot2")), robots=4),
    ),
    "takes_a_proposal_for_the_tree": ("links kept are of a tree in force", _case(4.0)),
    "counts_trees_anew": ("trees are numbered", _case(16.0, robots=3)),
    "puts_in_force_what_is_new": ("trees span their members", _case(20.0, robots=3)),
    "takes_an_earlier_tree": (
        "nobody goes back to an earlier tree",
        _case(16.0, Pause(at_s=4.0, for_s=3.0, who="base"), Kill(at_s=9.0, who="leader"), robots=4),
    ),
    "goes_before_the_tree_is_in_force": (
        "nobody goes where another tree is needed",
        _case(14.0, Delay(at_s=0.0, least_s=0.05, mean_s=0.0), Kill(at_s=8.0, who="leader"), robots=4),
    ),
    "goes_while_another_tree_is_negotiated": (
        "nobody goes where another tree is needed",
        _case(16.0, Delay(at_s=5.0, hearers=("base",), least_s=0.05, mean_s=0.0), robots=3, seed=2),
    ),
    "keeps_proposals_open": (
        "proposals are bounded",
        _case(
            16.0,
            *(Cut(at_s=4.0 + 1.6 * time, for_s=1.3, speakers=("robot1",), hearers=("base",)) for time in range(8)),
            robots=3,
        ),
    ),
    "never_stands": (
        "a team is led soon after the last fault",
        _case(12.0, Kill(at_s=3.0, for_s=0.5, who="leader")),
    ),
    "waits_for_everybody": (
        "a team that is led has a plan soon",
        _case(11.0, Kill(at_s=3.0, who="robot3"), Kill(at_s=6.0, who="leader"), robots=4),
    ),
    "remembers_everything": ("memory is bounded", _case(26.0, robots=1)),
    "forgets_the_round_trip": (
        INSIDE,
        _case(14.0, Delay(at_s=0.0, speakers=("agent",), least_s=0.25, mean_s=0.0), robots=1, announces=False),
    ),
    "forgets_the_clock_bound": (
        INSIDE,
        _case(
            20.0,
            Clock(at_s=0.0, who="base", offset_s=-0.025),
            Clock(at_s=0.0, who="robot1", offset_s=0.025),
            robots=1,
            seed=3,
            announces=False,
        ),
    ),
    "predicts_half_the_walk": (
        INSIDE,
        _case(8.0, Cut(at_s=3.0, speakers=("agent",)), robots=1, announces=False),
    ),
    "stamps_ranges_on_arrival": (
        INSIDE,
        _case(
            12.0,
            Delay(at_s=0.0, speakers=("base",), hearers=("robot1",), least_s=1.5, mean_s=0.0),
            robots=1,
            announces=False,
        ),
    ),
    "folds_at_the_present_time": (INSIDE, _case(16.0, robots=1, announces=False)),
    "believes_a_lying_radio": (INSIDE, _case(10.0, robots=1, announces=False)),
    "sends_all_to_one_lane": ("robots do not touch", _case(10.0)),
    "fails_on_a_vanished_peer": ("roles fail on nothing", _case(4.0, Kill(at_s=3.0, who="agent"))),
}
"""By mutant: the rule that it breaks, and where."""

FURTHER: Final[dict[str, tuple[str, ChaosCase]]] = {
    "obeys_after_the_lease": (  # robot2 hangs, so that the base station leads again, in another process
        "all obey the same",
        _case(8.0, DEAF, Kill(at_s=3.0, for_s=0.1, who="base"), Pause(at_s=3.0, for_s=1.2, who="robot2")),
    ),
}
"""Mutants that break another rule elsewhere."""

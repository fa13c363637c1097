"""No history within bounds breaks a rule, and with a rule left out one does."""

from __future__ import annotations

import pytest

from protocol.held_tree import HeldTree
from protocol.negotiation import Negotiation
from tests.protocol import topology_mutants as mutants
from tests.protocol.topology_exploration import ONE_REIGN, TWO_REIGNS, Broken, Wishes, explore


def test_no_history_of_one_reign_breaks_a_rule() -> None:
    assert explore(ONE_REIGN[1:], refusals=1) > 100


def test_no_history_with_a_new_leader_breaks_a_rule() -> None:
    assert explore(TWO_REIGNS) > 200


@pytest.mark.parametrize(
    ("mutant", "wishes", "refusals", "says"),
    [
        (mutants.OneEndIsEnough, ONE_REIGN, 0, "has not confirmed"),
        (mutants.CommitsAtOnce, ONE_REIGN, 0, "has not confirmed"),
        (mutants.RefusalsCount, ONE_REIGN, 1, "has not confirmed"),
        (mutants.AnyProposalsAnswers, ONE_REIGN, 0, "has not confirmed"),
        (mutants.TrustsItsPredecessor, TWO_REIGNS, 0, "has not confirmed"),
        (mutants.NeverGivesUp, ONE_REIGN, 0, "open for longer"),
    ],
)
def test_a_history_is_found_for_each_rule_of_the_leader_that_is_left_out(
    mutant: type[Negotiation], wishes: Wishes, refusals: int, says: str
) -> None:
    with pytest.raises(Broken, match=says):
        explore(wishes, negotiation=mutant, refusals=refusals)


@pytest.mark.parametrize(
    ("mutant", "says"),
    [
        (mutants.ReleasesFirst, "before another tree is in force"),
        (mutants.MakesBeforeItIsInForce, "keeps what never came into force"),
    ],
)
def test_a_history_is_found_for_each_rule_of_those_who_keep_links_that_is_left_out(
    mutant: type[HeldTree], says: str
) -> None:
    with pytest.raises(Broken, match=says):
        explore(ONE_REIGN, held=mutant)

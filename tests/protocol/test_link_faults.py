"""Links that lose on purpose: what passes, both ways, and tokens that go with a cut and come back after it."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol.bus import BusEvent, PeerAppeared, PeerVanished, Received
from protocol.keys import Address
from protocol.link_faults import CUT, TOKEN_S, LinkFilter, LinkTable

NAMES = ("base", "robot1", "robot2")


def said(speaker: str, *, operator: bool = False) -> Received:
    return Received(Address("team", speaker, "state", operator=operator).key, b"{}")


def percent(**lost: int) -> list[list[int]]:
    """A table in which ``base_robot1=30`` means that robot1 does not hear 30 % of what base says."""
    return [[lost.get(f"{speaker}_{hearer}", 0) for hearer in NAMES] for speaker in NAMES]


@pytest.fixture
def table(tmp_path: Path) -> LinkTable:
    return LinkTable(tmp_path / "links", NAMES, create=True)


def test_what_one_process_writes_another_reads_at_once(table: LinkTable, tmp_path: Path) -> None:
    other = LinkTable(tmp_path / "links", NAMES)
    assert other.lost_percent("base", "robot1") == 0
    table.lose(percent(base_robot1=CUT, robot2_base=30))
    seen = {(a, b): other.lost_percent(a, b) for a in NAMES for b in NAMES if other.lost_percent(a, b)}
    assert seen == {("base", "robot1"): CUT, ("robot2", "base"): 30}
    assert other.lost_percent("somebody", "base") == other.lost_percent("base", "somebody") == 0
    with pytest.raises(TypeError):  # peers only read
        other.lose(percent())


def test_a_table_of_another_team_is_refused(table: LinkTable, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"links: is no table of the links of 2 peers"):
        LinkTable(tmp_path / "links", NAMES[:2])


def test_a_cut_is_one_way_and_spares_operators(table: LinkTable) -> None:
    heard: list[BusEvent] = []
    at_robot1 = LinkFilter(table, "robot1", heard.append, seed=0)
    table.lose(percent(base_robot1=CUT, robot1_robot2=CUT))
    for event in (said("base"), said("robot2"), said("base", operator=True), Received("no key of ours", b"")):
        at_robot1.deliver(event)
    assert heard == [said("robot2"), said("base", operator=True), Received("no key of ours", b"")]


def test_a_share_is_lost(table: LinkTable) -> None:
    heard: list[BusEvent] = []
    at_robot1 = LinkFilter(table, "robot1", heard.append, seed=3)
    table.lose(percent(base_robot1=30))
    for _ in range(4000):
        at_robot1.deliver(said("base"))
    assert 0.65 < len(heard) / 4000 < 0.75  # four standard deviations are 0.03


def test_a_token_goes_a_lease_after_the_cut_and_comes_back_with_the_link(table: LinkTable) -> None:
    heard: list[BusEvent] = []
    at_base = LinkFilter(table, "base", heard.append, seed=0)
    at_base.deliver(PeerAppeared("robot1"))
    table.lose(percent(robot1_base=CUT))
    at_base.look(10.0)
    at_base.look(10.0 + 0.9 * TOKEN_S)
    assert heard == [PeerAppeared("robot1")]
    at_base.look(10.0 + TOKEN_S)
    at_base.look(20.0)
    assert heard[1:] == [PeerVanished("robot1")]
    table.lose(percent())
    at_base.look(20.1)
    assert heard[2:] == [PeerAppeared("robot1")]


ACTIONS = st.lists(
    st.sampled_from(["appear", "vanish", "cut", "heal", "look", "wait"]).flatmap(
        lambda what: st.tuples(st.just(what), st.sampled_from(NAMES[1:]))
    ),
    max_size=30,
)


@given(ACTIONS)
@settings(max_examples=60, deadline=None)
def test_whatever_happens_coming_and_going_alternate_and_end_at_the_truth(
    tmp_path_factory: pytest.TempPathFactory, actions: list[tuple[str, str]]
) -> None:
    table = LinkTable(tmp_path_factory.mktemp("run") / "links", NAMES, create=True)
    heard: list[BusEvent] = []
    at_base = LinkFilter(table, "base", heard.append, seed=0)
    cut: dict[str, int] = {}
    tokens: set[str] = set()
    now_s = 0.0
    for what, peer in actions:
        now_s += TOKEN_S if what == "wait" else 0.05
        match what:
            case "appear" if peer not in tokens:
                tokens.add(peer)
                at_base.deliver(PeerAppeared(peer))
            case "vanish" if peer in tokens:
                tokens.remove(peer)
                at_base.deliver(PeerVanished(peer))
            case "cut" | "heal":
                cut[f"{peer}_base"] = CUT if what == "cut" else 0
                table.lose(percent(**cut))
            case "look" | "wait":
                at_base.look(now_s)
    for later_s in (0.1, 0.1 + TOKEN_S):
        at_base.look(now_s + later_s)
    for peer in NAMES[1:]:
        signs = [isinstance(event, PeerAppeared) for event in heard if getattr(event, "peer", "") == peer]
        assert signs == [place % 2 == 0 for place in range(len(signs))]
        assert (len(signs) % 2 == 1) == (peer in tokens and not cut.get(f"{peer}_base"))

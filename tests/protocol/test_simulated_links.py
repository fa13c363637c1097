"""Faulty links do what is asked of them, to what is asked, and to nothing else."""

from __future__ import annotations

from random import Random
from statistics import fmean

import pytest

from protocol.bus import BusEvent, PeerAppeared, PeerVanished, Received
from protocol.messages import Envelope, Heartbeat, MalformedMessage, decode, encode
from protocol.simulated_bus import SimulatedBus, SimulatedNetwork, VirtualTime
from protocol.simulated_links import Delays, LinkFaults

MESSAGE = encode(
    Envelope(sender="a", incarnation=3, sequence=12, sent_at_s=7.25, body=Heartbeat(role="robot", mode="moving"))
)


class Team:
    """Peers that remember what they hear and when."""

    def __init__(self, *names: str, seed: int = 1) -> None:
        self.time = VirtualTime()
        self.network = SimulatedNetwork(self.time, seed, (0.001, 0.003))
        self.heard: dict[str, list[tuple[float, BusEvent]]] = {name: [] for name in names}
        self.buses = {name: self.attach(name) for name in names}
        self.time.run_until(1.0)
        for events in self.heard.values():
            events.clear()

    def attach(self, name: str) -> SimulatedBus:
        def hear(event: BusEvent) -> None:
            self.heard[name].append((self.time.now_s, event))

        return self.network.attach(name, hear)

    def speak(self, name: str, count: int, every_s: float = 1.0) -> list[tuple[float, int]]:
        """Say numbers, and let them arrive; when each of them arrived at b."""
        start_s = self.time.now_s
        for number in range(count):
            self.time.call_at(
                start_s + number * every_s, self.buses[name].publish, f"t/v1/{name}/state", b"%d" % number
            )
        self.time.run_until(start_s + count * every_s + 1e4)
        arrived = [
            (time_s - start_s, int(event.payload)) for time_s, event in self.heard["b"] if isinstance(event, Received)
        ]
        return [(time_s - number * every_s, number) for time_s, number in arrived]

    def tokens(self, name: str) -> list[BusEvent]:
        return [event for _, event in self.heard[name] if not isinstance(event, Received)]


def test_a_cut_goes_one_way_and_spares_the_other_links() -> None:
    team = Team("a", "b", "c")
    team.network.set_faults("a", "b", LinkFaults(cut=True))
    team.speak("a", 5)
    assert not team.heard["b"]
    assert len(team.heard["c"]) == 5
    assert team.speak("c", 5)
    team.network.set_faults("a", "b", None)
    assert len(team.speak("a", 5)) == 10, "five of c, and five of a now"
    assert team.network.lost == 5


def test_what_is_on_its_way_arrives_although_the_link_is_cut() -> None:
    team = Team("a", "b")
    team.buses["a"].publish("t/v1/a/state", b"0")
    team.network.set_faults("a", "b", LinkFaults(cut=True))
    team.time.run_until(2.0)
    assert len(team.heard["b"]) == 1


@pytest.mark.parametrize("noticed", [True, False])
def test_tokens_do_not_cross_a_cut_and_are_made_up_for(noticed: bool) -> None:
    team = Team("a", "b")
    team.network.set_faults("a", "b", LinkFaults(cut=True))
    if noticed:
        team.network.hide_token("a", "b")
    team.buses["a"].close()
    team.time.run_until(2.0)
    assert team.tokens("b") == ([PeerVanished("a")] if noticed else [])
    team.attach("a")
    team.time.run_until(3.0)
    assert team.tokens("b") == ([PeerVanished("a")] if noticed else [])
    team.network.set_faults("a", "b", None)
    team.time.run_until(4.0)
    assert team.tokens("b") == [PeerVanished("a"), PeerAppeared("a")], "another process, whether noticed or not"


def test_a_token_that_is_not_cut_off_is_not_hidden() -> None:
    team = Team("a", "b")
    team.network.hide_token("a", "b")
    team.time.run_until(2.0)
    assert not team.heard["b"]


@pytest.mark.parametrize(("back_at_s", "seen"), [(None, 1), (3.0, 2)])
def test_a_peer_that_loses_power_is_missed_later(back_at_s: float | None, seen: int) -> None:
    team = Team("a", "b")
    team.buses["a"].close(noticed_after_s=5.0)
    team.time.run_until(3.0)
    assert not team.heard["b"]
    if back_at_s is not None:
        team.attach("a")
    team.time.run_until(5.9)
    assert len(team.tokens("b")) == (seen if back_at_s else 0)
    team.time.run_until(9.0)
    assert team.tokens("b") == [PeerVanished("a"), PeerAppeared("a")][:seen]


@pytest.mark.parametrize("burst", [1.0, 8.0])
def test_loss_comes_in_bursts_of_the_length_asked_for(burst: float) -> None:
    team = Team("a", "b")
    team.network.set_faults("a", "b", LinkFaults(loss=0.3, burst=burst))
    arrived = {number for _, number in team.speak("a", 20_000)}
    lost = [number not in arrived for number in range(20_000)]
    bursts = sum(now and not before for now, before in zip(lost, [False, *lost], strict=False))
    assert fmean(lost) == pytest.approx(0.3, abs=0.03)
    # Independent losses of share p come in rows of mean 1 / (1 - p).
    assert sum(lost) / bursts == pytest.approx(burst if burst > 1.0 else 1 / 0.7, rel=0.12)


@pytest.mark.parametrize(
    ("delays", "mean_s", "beyond", "share"),
    [
        (Delays(0.1, 0.2, "uniform"), 0.3, 0.5, 0.0),
        (Delays(0.1, 0.2, "exponential"), 0.3, 0.5, 0.1353),  # exp(-2)
        (Delays(0.1, 0.2, "log-normal"), 0.3, 0.5, 0.1131),  # of a normal variable beyond (ln 2 + 1.125) / 1.5
        (Delays(0.1, 0.0, "uniform", spikes=0.25, spike_s=2.0), 0.6, 1.0, 0.25),
    ],
)
def test_delays_are_distributed_as_asked(delays: Delays, mean_s: float, beyond: float, share: float) -> None:
    team = Team("a", "b")
    team.network.set_faults("a", "b", LinkFaults(delays=delays))
    took_s = [delay_s for delay_s, _ in team.speak("a", 20_000, every_s=100.0)]
    assert len(took_s) == 20_000
    assert min(took_s) >= 0.1 - 1e-6
    assert fmean(took_s) == pytest.approx(mean_s, rel=0.06)
    assert fmean(delay_s > beyond for delay_s in took_s) == pytest.approx(share, abs=0.01)


def test_only_where_it_is_asked_for_does_anything_overtake() -> None:
    for overtaking in (False, True):
        team = Team("a", "b")
        team.network.set_faults("a", "b", LinkFaults(delays=Delays(0.0, 1.0, "exponential", overtaking=overtaking)))
        order = [number for _, number in team.speak("a", 200, every_s=0.1)]
        assert sorted(order) == list(range(200))
        assert (order != sorted(order)) is overtaking


def test_duplicates_arrive_twice_and_later() -> None:
    team = Team("a", "b")
    team.network.set_faults("a", "b", LinkFaults(duplicates=0.4))
    arrived = [number for _, number in team.speak("a", 2000)]
    assert set(arrived) == set(range(2000))
    assert len(arrived) / 2000 == pytest.approx(1.4, abs=0.04)
    assert team.network.delivered == len(arrived)


def test_what_is_corrupted_is_no_message_and_its_key_stands() -> None:
    team = Team("a", "b")
    team.network.set_faults("a", "b", LinkFaults(corrupted=0.5))
    for _ in range(2000):
        team.buses["a"].publish("t/v1/a/heartbeat", MESSAGE)
    team.time.run_until(9.0)
    arrived = [event for _, event in team.heard["b"] if isinstance(event, Received)]
    assert len(arrived) == 2000
    assert {event.key for event in arrived} == {"t/v1/a/heartbeat"}
    wrong = [event.payload for event in arrived if event.payload != MESSAGE]
    assert len(wrong) / 2000 == pytest.approx(0.5, abs=0.04)
    assert len(set(wrong)) > 500, "damaged in many ways"
    for payload in wrong:
        with pytest.raises(MalformedMessage):
            decode(payload)


def test_what_happens_on_one_link_changes_nothing_on_another() -> None:
    def at_c(faults: LinkFaults | None) -> list[tuple[float, BusEvent]]:
        team = Team("a", "b", "c", seed=4)
        team.network.set_faults("a", "b", faults)
        team.speak("a", 50)
        return team.heard["c"]

    bad = LinkFaults(loss=0.5, burst=3.0, duplicates=0.5, delays=Delays(0.0, 1.0, "log-normal"))
    assert at_c(None) == at_c(bad)


def test_faulty_links_repeat_themselves() -> None:
    def history(seed: int) -> list[tuple[float, BusEvent]]:
        team = Team("a", "b", seed=seed)
        chance = Random(seed)
        for _ in range(20):
            faults = LinkFaults(
                loss=chance.random(), burst=1.0 + 5.0 * chance.random(), duplicates=chance.random(),
                delays=Delays(0.0, 0.5, "log-normal", 0.1, 3.0, overtaking=chance.random() < 0.5),
            )  # fmt: skip
            team.network.set_faults("a", "b", faults)
            for number in range(10):
                team.buses["a"].publish("t/v1/a/state", b"%d" % number)
            team.time.run_until(team.time.now_s + 0.5)
        return team.heard["b"]

    assert history(3) == history(3) != history(5)

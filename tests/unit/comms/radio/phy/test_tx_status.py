"""Senders who ask learn once what became of each addressed packet, and no more than a radio can know."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.sentinels import BROADCAST, NO_TX_STATUS, NOWHERE
from swarmwire.comms.radio.config.impairments import Bursts
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.disruption import Disruption
from swarmwire.comms.radio.unit_disk.tx_queue import QUEUE_FULL
from swarmwire.comms.robot.packets import Fate, SentPackets, TxResult, TxStatuses
from tests.support.comms.radio import METHODS, Run, at, make_medium, packets, run, scattered, with_access
from tests.unit.world.scenario.test_bodies import radio_of

ACKNOWLEDGING = ("csma-802154", "dcf")
NEAR, FAR = at((0, 0), (1, 0)), at((0, 0), (5000, 0))


class Asking:
    """Numbers packets as agents do: each robot its own, and asks for the transmit status of those to one robot."""

    def __init__(self, rows: int) -> None:
        self._sent = np.zeros(rows, np.int64)
        self.requested: list[tuple[int, int]] = []

    def __call__(self, sent: SentPackets) -> SentPackets:
        ids = np.full(len(sent), NO_TX_STATUS)
        for k, (sender, to) in enumerate(zip(sent.sender.tolist(), sent.to.tolist(), strict=True)):
            if to != BROADCAST:
                ids[k] = self._sent[sender]
                self.requested.append((sender, int(ids[k])))
            self._sent[sender] += 1
        return replace(sent, tx_status_id=ids)


def count_acknowledged(result: Run) -> int:
    return int(np.count_nonzero(result.tx_status("result") == TxResult.ACKNOWLEDGED))


def listed(tx_status: TxStatuses) -> list[tuple[int, int, str]]:
    """Robot row, id and result."""
    names = [TxResult(result).name for result in tx_status.result.tolist()]
    return list(zip(tx_status.row.tolist(), tx_status.id.tolist(), names, strict=True))


def learned(result: Run) -> list[tuple[int, int, str]]:
    """Robot row, id and result of all ticks."""
    return [status for step in result.news for status in listed(step.tx_status)]


def run_asking(radio: Radio, pose: FloatArray, sent: SentPackets, ticks: int = 1, quiet_ticks: int = 3) -> Run:
    ask = Asking(len(pose))
    return run(make_medium(radio, len(pose)), pose, lambda _: ask(sent), ticks, quiet_ticks)


def results(radio: Radio, pose: FloatArray, sent: SentPackets) -> list[str]:
    return [result for _, _, result in learned(run_asking(radio, pose, sent))]


@st.composite
def radios(draw: st.DrawFn) -> Radio:
    radio = with_access(draw(st.sampled_from(ACKNOWLEDGING)))
    slow = radio.frame == "plain" and draw(st.booleans())
    access = replace(radio.access_or_default, max_retries=draw(st.integers(0, 3)))
    return replace(
        radio,
        access=access,
        bit_rate_bps=draw(st.sampled_from([900, 30_000])) if slow else radio.bit_rate_bps,
        max_payload_bytes=draw(st.integers(10, 60)),
        queue_limit=draw(st.integers(0, 4)),
        send_offset=draw(st.sampled_from(["uniform", "tick"])),
        loss=draw(st.sampled_from([0.0, 0.3, 0.7])),
    )


def mixed(rng: np.random.Generator, rows: int, robots: int) -> SentPackets:
    """Some robots send some packets: to one, to all, or to nobody."""
    k = int(rng.integers(0, 3 * rows))
    sender, kind = rng.integers(0, rows, k), rng.random(k)
    to = (sender + rng.integers(1, robots, k)) % robots
    to = np.where(kind < 0.6, to, np.where(kind < 0.9, BROADCAST, NOWHERE))
    return packets(sender, to, rng.integers(1, 70, k))


@given(radios(), st.integers(1, 2), st.integers(2, 8), st.integers(0, 1000), st.sampled_from([0, 1, 40]))
def test_tx_status_is_single_for_each_addressed_packet(
    radio: Radio, arenas: int, robots: int, seed: int, quiet_ticks: int
):
    rng, rows = np.random.default_rng(seed), arenas * robots
    medium, ask = make_medium(radio, robots, range(arenas)), Asking(rows)
    pose = scattered(rows, seed) * [rng.choice([1.0, 30.0]), 20.0, 1.0]
    result = run(medium, pose, lambda _: ask(mixed(rng, rows, robots)), 4, quiet_ticks)
    answered = [(row, id_) for row, id_, _ in learned(result)]
    assert len(set(answered)) == len(answered)
    assert set(answered) <= set(ask.requested)
    if quiet_ticks == 40 and radio.bit_rate_bps != 900:
        assert sorted(answered) == sorted(ask.requested)
    # As the ids count all packets, they are the medium's sequence numbers too.
    arena_of = {(row % robots, row // robots): row for row in range(rows)}
    fate: dict[tuple[int, int], set[int]] = {}
    for arena, sender, sequence, value in result.rows("finished", "arena", "sender", "sequence", "fate"):
        fate.setdefault((arena_of[sender, arena], sequence), set()).add(value)
    for step in result.news:
        assert listed(step.tx_status) == sorted(listed(step.tx_status), key=lambda row: row[:2])
    for row, id_, answer in learned(result):
        if answer == "ACKNOWLEDGED":
            assert fate[row, id_] == {Fate.RECEIVED}
        if answer == "QUEUE_FULL":
            assert fate[row, id_] == {QUEUE_FULL}
        if answer == "TOO_LARGE":
            assert fate.get((row, id_), {Fate.TOO_LARGE}) == {Fate.TOO_LARGE}


@pytest.mark.parametrize("method", ACKNOWLEDGING)
@pytest.mark.parametrize(
    ("change", "pose", "count", "expected"),
    [
        ({}, NEAR, 1, ["ACKNOWLEDGED"]),
        ({}, FAR, 1, ["NO_ACKNOWLEDGEMENT"]),
        ({"loss": 1.0}, NEAR, 1, ["NO_ACKNOWLEDGEMENT"]),
        ({"max_payload_bytes": 9}, NEAR, 1, ["TOO_LARGE"]),
        ({"send_offset": 0.25}, NEAR, 1, ["ACKNOWLEDGED"]),
        ({"queue_limit": 2}, NEAR, 5, ["ACKNOWLEDGED"] * 3 + ["QUEUE_FULL"] * 2),
    ],
)
def test_tx_status_is_what_the_sender_sees(method: str, change, pose: FloatArray, count: int, expected: list[str]):
    assert results(replace(with_access(method), **change), pose, packets([0] * count, 1)) == expected


def test_tx_status_is_channel_busy_even_after_a_failed_attempt():
    """Every third tick two robots want to send: one a frame of 160 ms, the other one that is always lost, and again."""
    radio = replace(with_access("csma-802154"), send_offset="tick", max_payload_bytes=5000, loss=1.0)
    pose, both = at((0, 0), (1, 0), (0.5, 1)), packets([0, 2], [1, BROADCAST], [10, 5000])
    ask = Asking(3)
    result = run(make_medium(radio, 3), pose, lambda tick: ask(both) if tick % 3 == 0 else SentPackets.none(), 120, 3)
    busy = {id_ for _, id_, answer in learned(result) if answer == "CHANNEL_BUSY"}
    links = result.rows("finished", "sender", "sequence", "fate")
    fates = {sequence: fate for sender, sequence, fate in links if sender == 0}
    assert {fates[id_] for id_ in busy} >= {Fate.CHANNEL_BUSY, Fate.LOST}
    assert {id_ for id_, fate in fates.items() if fate == Fate.CHANNEL_BUSY} <= busy


@pytest.mark.parametrize("method", ACKNOWLEDGING)
@pytest.mark.parametrize("loss", [{"loss": 0.5}, {"bursts": Bursts(loss_bad=0.5, loss_good=0.5)}], ids=str)
def test_acknowledgement_passes_the_losses_that_frames_pass(method: str, loss: dict[str, Any]):
    """Of half of the packets, half of the acknowledgements: those lost leave a received packet not acknowledged."""
    radio = with_access(method)
    radio = replace(radio, **loss, access=replace(radio.access_or_default, max_retries=0))
    result = run_asking(radio, NEAR, packets([0], 1), 300, 1)
    received, acknowledged = len(result.received("sender_index")), count_acknowledged(result)
    assert len(learned(result)) == 300
    # 150 and 75 of 300, within four standard deviations (one false alarm in ten thousand seeds); the seed is fixed.
    assert abs(received - 150) < 35
    assert abs(acknowledged - 75) < 30


def test_acknowledgement_is_decoded_at_its_own_bit_rate():
    """Where half of the frames at 54 Mbit/s are lost, all acknowledgements, at 24 Mbit/s, are right."""
    radio = radio_of({"preset": "wifi-a-6M", "bit_rate_bps": 54_000_000, "access": {"method": "dcf", "max_retries": 0}})
    result = run_asking(radio, at((0, 0), (37, 0)), packets([0], 1, 20), 300)
    received = len(result.received("sender_index"))
    assert 75 < received < 225
    assert count_acknowledged(result) == received


def test_tx_status_arrives_in_the_next_tick():
    for method in ACKNOWLEDGING:
        news = run_asking(with_access(method), NEAR, packets([0], 1), 3, 2).news
        acknowledged = [[(0, tick, "ACKNOWLEDGED")] for tick in range(3)]
        assert [listed(step.tx_status) for step in news] == [[], *acknowledged, [], []]


@pytest.mark.parametrize("method", METHODS)
def test_tx_status_is_absent_without_request_or_acknowledgements(method: str):
    assert learned(run(make_medium(with_access(method), 2), NEAR, lambda _: packets([0], 1), 3)) == []
    assert results(with_access(method), NEAR, packets([0, 1])) == []
    if method not in ACKNOWLEDGING:
        assert results(with_access(method), NEAR, packets([0, 1], [1, 0])) == []
    radio = with_access(method)
    silent = replace(radio, access=replace(radio.access_or_default, acknowledged=False))
    assert results(silent, NEAR, packets([0, 0], [1, NOWHERE])) == []
    assert results(Radio(range_m=2.0), NEAR, packets([0, 0], [1, NOWHERE])) == []


@pytest.mark.parametrize("method", ["unit-disk", *METHODS])
def test_packet_to_nobody_is_sent_without_acknowledgement(method: str):
    radio = Radio(range_m=2.0) if method == "unit-disk" else with_access(method)
    result = run_asking(radio, NEAR, packets([0, 0, 0], [NOWHERE, 1, NOWHERE]), 2)
    assert result.received("sequence").tolist() == [1, 4]
    assert (result.tally.sent.tolist(), result.tally.intended.tolist()) == ([6], [2])
    assert np.count_nonzero(result.departed("fate") == Fate.RECEIVED) == 6  # they were on air
    lost = [(0, id_, "NO_ACKNOWLEDGEMENT") for id_ in (0, 2, 3, 5)]
    expected = sorted([*lost, (0, 1, "ACKNOWLEDGED"), (0, 4, "ACKNOWLEDGED")]) if method in ACKNOWLEDGING else []
    assert sorted(learned(result)) == expected


@pytest.mark.parametrize("method", ["unit-disk", *METHODS])
@pytest.mark.parametrize("retries", [0, 3])
def test_packet_to_nobody_takes_airtime_for_all_attempts(method: str, retries: int):
    """The next packet of its sender, 12 ms long as this one, waits for the attempts and, on the PHY, their backoffs."""
    radio = Radio(range_m=2.0, bit_rate_bps=8000, max_payload_bytes=12, send_offset="tick")
    if method != "unit-disk":
        radio = replace(with_access(method), max_payload_bytes=1500, send_offset="tick")
        radio = replace(radio, access=replace(radio.access_or_default, max_retries=retries))
    size = 12 if method == "unit-disk" else 1500
    result = run(make_medium(radio, 2), NEAR, lambda _: packets([0, 0], [NOWHERE, 1], size), 1, 20)
    is_next = result.departed("sequence") == 1
    on_air_ns = result.departed("on_air_at_ns")[is_next]
    airtime_ns = result.departed("off_air_at_ns")[is_next] - on_air_ns
    attempts = 1 + (retries if method in ACKNOWLEDGING else 0)
    assert attempts <= on_air_ns / airtime_ns < attempts + 1


def test_packets_to_nobody_alone_have_a_tx_status():
    assert results(with_access("csma-802154"), NEAR, packets([0, 1], NOWHERE)) == ["NO_ACKNOWLEDGEMENT"] * 2
    too_large = packets([0], NOWHERE, 111)
    assert results(with_access("csma-802154"), NEAR, too_large) == ["TOO_LARGE"]


def test_tx_status_is_dropped_at_death_and_negative_with_the_radio_off():
    radio = replace(with_access("csma-802154"), bit_rate_bps=2000, send_offset="tick")
    for alive, radio_on, expected in (
        ([False, True], [True, True], []),
        ([True, True], [False, True], ["NO_ACKNOWLEDGEMENT"] * 3),
    ):
        ask, result = Asking(2), Run(make_medium(radio, 2))
        for tick in range(30):
            disruption = replace(Disruption.none(2), alive=np.array(alive), radio_on=np.array(radio_on))
            result.news.append(result.medium.step(tick * 10**8, NEAR, disruption if tick == 1 else None))
            result.medium.send(tick * 10**8, tick, ask(packets([0] * 3, 1) if tick == 0 else SentPackets.none()))
        assert [answer for _, _, answer in learned(result)] == expected

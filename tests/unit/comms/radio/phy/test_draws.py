"""Each fate over signals is computed once more from its draws; the cut-off decides who disturbs."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.base.draws import derive_key, purpose, uniform
from swarmwire.comms.radio.config.impairments import Bursts
from swarmwire.comms.radio.phy.params import phy_params_of
from swarmwire.comms.radio.phy.success import lone_deliveries
from swarmwire.comms.robot.packets import Fate, SentPackets, TxResult
from tests.support.comms.radio import (
    METHODS,
    Run,
    at,
    drawing,
    everybody,
    make_medium,
    numbers_received,
    packets,
    run,
    scattered,
    with_access,
)

ROBOTS = 8


def links_of(result: Run) -> list[tuple[int, ...]]:
    """Every link's fate, with when."""
    columns = ("receiver", "sender", "sequence", "fate", "on_air_at_ns", "final_at_ns")
    return sorted(result.rows("finished", *columns))


@pytest.mark.parametrize("method", METHODS)
def test_robot_beyond_the_cut_off_changes_nothing(method: str):
    """It stands far away and sends all the time."""
    radio = replace(drawing(method), range_m=40.0)
    pose = scattered(ROBOTS)
    pose[-1, :2] = 60.0, 60.0
    with_it, without = (
        run(make_medium(radio, ROBOTS), pose, lambda _, k=k: packets([*range(ROBOTS - 1)] + [ROBOTS - 1] * k), 4, 2)
        for k in (5, 0)
    )
    rows = links_of(without)
    assert rows
    assert [row for row in links_of(with_it) if ROBOTS - 1 not in row[:2]] == rows


def test_cut_off_decides_which_robots_interfere():
    """A link at 1 dB over noise, and 20 robots that send at the same time, each at the receiver's noise less 9 dB."""
    radio = with_access("aloha")
    near_m, far_m = (10.0 ** ((-radio.noise_or_default.power_dbm - 46.6777 - db) / 30.0) for db in (1.0, -9.0))
    pose = np.zeros((22, 3))
    pose[1:, 0] = -far_m
    pose[1, 0] = near_m
    received = {}
    for senders, cut_off_db in ((2, 10.0), (22, 8.0), (22, 10.0)):
        sent = packets([*range(1, senders)])
        result = run(make_medium(replace(radio, cut_off_db=cut_off_db), 22), pose, lambda _, sent=sent: sent, 30)
        received[senders, cut_off_db] = len(numbers_received(result, 1, 0))
    assert received[2, 10.0] == received[22, 8.0] > 20
    assert received[22, 10.0] < 10


SEEDS = (3, 8)
THREE = 3
KEYS = np.array([derive_key(seed, "air") for seed in SEEDS], np.uint64)


def draws_of(result: Run, name: str) -> np.ndarray:
    arena = result.on_air("arena")
    columns = (result.on_air(name) for name in ("sender", "receiver", "sequence"))
    return uniform(KEYS[arena], *columns, purpose(name))


def test_weak_frame_is_decoded_if_its_draw_is_below_the_probability():
    """Two robots in each arena, too far apart for every frame to be right; what is not counts as out of range."""
    radio = replace(with_access("none"), send_offset="tick")
    pose, ticks = np.concatenate([at((0, 0), (112, 0)), at((0, 0), (116, 0))]), 40
    result = run(make_medium(radio, 2, SEEDS), pose, everybody(4), ticks, 1)
    arena, sender, sequence = (
        column.ravel() for column in np.meshgrid(range(2), range(2), range(ticks), indexing="ij")
    )
    rssi_dbm = [result.on_air("rssi_dbm")[result.on_air("arena") == column][0] for column in range(2)]
    likely = lone_deliveries(phy_params_of(radio, 2), np.array(rssi_dbm), 8.0 * (10 + radio.overhead_bytes))
    is_right = uniform(KEYS[arena], sender, 1 - sender, sequence, purpose("reception")) < likely[arena]
    assert 0 < np.count_nonzero(is_right) < len(is_right)
    received = zip(*(result.on_air(name).tolist() for name in ("arena", "sender", "sequence")), strict=True)
    expected = zip(arena[is_right].tolist(), sender[is_right].tolist(), sequence[is_right].tolist(), strict=True)
    assert sorted(received) == sorted(expected)


def test_retries_and_answers_over_a_weak_link_have_separate_draws():
    """A packet is sent up to three times, until an answer to it is right; it is received if one of its frames is."""
    radio = with_access("csma-802154")
    radio = replace(radio, access=replace(radio.access_or_default, max_retries=2), send_offset="tick")
    rules, ticks, frame_bits = phy_params_of(radio, 2), 80, 8.0 * (10 + radio.overhead_bytes)
    result = run(make_medium(radio, 2, SEEDS), np.tile(at((0, 0), (122, 0)), (2, 1)), asking([0, 2]), ticks, 2)
    rssi_dbm = result.on_air("rssi_dbm")[:1]
    frame, answer = (lone_deliveries(rules, rssi_dbm, bits)[0] for bits in (frame_bits, rules.ack_bits))
    keys, sequence, tries = KEYS[:, None, None], np.arange(ticks)[:, None], np.arange(3)
    right = uniform(keys, 0, 1, sequence, purpose("reception") + tries) < frame
    is_answered = right & (uniform(keys, 1, 0, sequence, purpose("reception of an acknowledgement") + tries) < answer)
    received = sorted(zip(result.on_air("arena").tolist(), result.on_air("sequence").tolist(), strict=True))
    assert received == [tuple(row) for row in np.argwhere(right.any(axis=2)).tolist()]
    acknowledged = sorted((row // 2, i) for i, row, status in learned(result) if status == int(TxResult.ACKNOWLEDGED))
    assert acknowledged == [tuple(row) for row in np.argwhere(is_answered.any(axis=2)).tolist()]
    assert 20 < len(acknowledged) < len(received) < 2 * ticks - 20


@pytest.mark.parametrize("loss", [0.3, 1.0])
def test_frame_is_lost_if_its_draw_is_below_the_loss(loss: float):
    radio = replace(with_access("none"), send_offset="tick", loss=loss)
    pose = np.tile(at((0, 0), (1, 0), (0, 1)), (2, 1))
    result = run(make_medium(radio, THREE, SEEDS), pose, everybody(2 * THREE), 10, 1)
    fate = np.where(draws_of(result, "fixed loss") < loss, Fate.LOST, Fate.RECEIVED)
    assert result.on_air("fate").tolist() == fate.tolist()


def asking(senders: list[int]) -> Callable[[int], SentPackets]:
    """A packet in each tick from each of these to robot 1 of its arena, with its transmit status, by the tick."""
    sent = packets(senders, 1)
    return lambda tick: SentPackets(sent.sender, sent.to, sent.payloads, np.full(len(senders), tick))


def learned(result: Run) -> list[tuple[int, int, int]]:
    """Transmit statuses (id, row, result), sorted."""
    return sorted(result.rows("tx_status", "id", "row", "result"))


def expected_end(key: np.uint64, sequence: int, loss: float, attempts: int) -> tuple[Fate, TxResult]:
    """The fate of a packet from robot 0 to 1, and what its sender learns: frames and answers are lost by draws."""
    fate = Fate.LOST
    for attempt in range(attempts):
        if uniform(key, 0, 1, sequence, purpose("fixed loss") + attempt) < loss:
            continue
        fate = Fate.RECEIVED
        if uniform(key, 1, 0, sequence, purpose("fixed loss of an acknowledgement") + attempt) >= loss:
            return fate, TxResult.ACKNOWLEDGED
    return fate, TxResult.NO_ACKNOWLEDGEMENT


@pytest.mark.parametrize(
    ("method", "loss", "max_retries", "attempts"),
    [("csma-802154", 0.6, 2, 3), ("dcf", 0.6, 2, 3), ("csma-802154", 0.9, None, 4), ("dcf", 0.9, None, 7)],
)
def test_unicast_attempts_and_answers_have_separate_draws(method: str, loss: float, max_retries, attempts: int):
    """macMaxFrameRetries counts retries; dot11ShortRetryLimit counts attempts (IEEE 802.11-2007, 9.2.5.3)."""
    radio, ticks = replace(with_access(method), loss=loss, send_offset="tick"), 60
    if max_retries is not None:
        radio = replace(radio, access=replace(radio.access_or_default, max_retries=max_retries))
    result = run(make_medium(radio, 2, SEEDS), np.tile(at((0, 0), (1, 0)), (2, 1)), asking([0, 2]), ticks, 2)
    expected = [expected_end(key, tick, loss, attempts) for tick in range(ticks) for key in KEYS]
    assert [status for _, _, status in learned(result)] == [status for _, status in expected]
    order = np.lexsort((result.on_air("arena"), result.on_air("sequence")))
    assert result.on_air("fate")[order].tolist() == [fate for fate, _ in expected]
    assert len(set(expected)) == 3


@pytest.mark.parametrize("method", ["none", "aloha"])
def test_bursts_alone_lose_frames_of_a_perfect_channel(method: str):
    radio = replace(with_access(method), send_offset="tick", bursts=Bursts(0.3, 0.3))
    pose = np.tile(at((0, 0), (1, 0), (0, 1)), (2, 1))
    fates = run(make_medium(radio, THREE, SEEDS), pose, lambda _: packets([0, THREE]), 60, 1).fates()
    assert set(fates) == {"RECEIVED", "BURST"}
    assert min(fates.values()) > 50


def test_csma_retry_waits_by_a_separate_backoff_draw():
    """Of packets whose first frame is lost and whose second is right, all that differs in time are two backoffs."""
    radio = with_access("csma-802154")
    radio = replace(radio, loss=0.6, access=replace(radio.access_or_default, max_retries=2), send_offset="tick")
    rules, ticks = phy_params_of(radio, 2), 60
    result = run(make_medium(radio, 2, SEEDS), np.tile(at((0, 0), (1, 0)), (2, 1)), asking([0, 2]), ticks, 2)
    arena, sequence = result.on_air("arena"), result.on_air("sequence")
    lost = [uniform(KEYS[arena], 0, 1, sequence, purpose("fixed loss") + attempt) < 0.6 for attempt in range(2)]
    second = lost[0] & ~lost[1]
    draws = [uniform(KEYS[arena], 0, sequence, 16 * attempt, purpose("csma backoff")) for attempt in range(2)]
    backoffs = sum(np.floor(u * 2**rules.min_be).astype(np.int64) for u in draws)
    waited_ns = result.on_air("final_at_ns") - result.on_air("sent_at_ns")
    assert np.count_nonzero(second) > 20
    assert len(set((waited_ns - backoffs * rules.backoff_ns)[second].tolist())) == 1

"""Contention and fading, against theory."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from swarmwire.comms.base.draws import derive_key
from swarmwire.comms.radio.analysis.contention import contention
from swarmwire.comms.radio.config.antennas import Antenna
from swarmwire.comms.radio.config.phy import Fading, ReceiverNoise, Reception, Shadowing
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.propagation.fading import fading_gain, fading_model
from swarmwire.comms.robot.packets import Fate
from tests.support.comms.radio import at, make_medium, packets, run, with_access

CSMA = replace(with_access("csma-802154"), send_offset="uniform", queue_limit=10**6)
DCF_B = replace(
    with_access("dcf"), send_offset="uniform", queue_limit=500, max_payload_bytes=1500, antenna=Antenna(16.0206)
)
DCF_A = replace(
    DCF_B,
    frame="802.11a",
    bit_rate_bps=6_000_000,
    reception=Reception("802.11ag", preamble_sinr_db=4.0, preamble_dbm=-82.0, capture_window_s=4e-6),
    noise=ReceiverNoise(20e6, 7.0),
)
# Figures of ns-3: nodes, payload in bytes, interval in s; delivery ratio, mean delay in ms.
FIGURES = [
    (CSMA, 2, 20, 0.1, 0.9963, 2.6624),
    (CSMA, 20, 20, 0.05, 0.8609, 4.9331),
    (CSMA, 80, 20, 0.1, 0.6078, 7.0160),
    (CSMA, 40, 49, 0.1, 0.7267, 8.0295),
    (CSMA, 80, 49, 0.05, 0.1591, 10.2433),
    (DCF_A, 2, 128, 0.02, 0.9995, 0.2812),
    (DCF_A, 40, 128, 0.02, 0.9447, 0.4583),
    (DCF_B, 10, 128, 0.05, 0.9944, 1.9336),
    (DCF_B, 80, 128, 0.1, 0.6025, 12.1015),
]
# Each sends in a slot with 2 / (W + 1), W = CW + 1 slots, and frames to all never double the window: a frame is alone
# with (1 - 2 / (W + 1))^(n - 1) (G. Bianchi, IEEE J. Sel. Areas Comm. 18, 2000, without retries). Few nodes, as theory
# leaves out that slots freeze. Keys are fixed.
B_1M = replace(with_access("dcf"), queue_limit=500)
A_6M = replace(
    B_1M,
    frame="802.11a",
    bit_rate_bps=6_000_000,
    noise=ReceiverNoise(20e6, 7.0),
    reception=Reception("802.11ag", preamble_sinr_db=4.0, preamble_dbm=-82.0, capture_window_s=4e-6),
)
PER_TICK = {"802.11a": 200, "802.11b": 40}  # more than there is time for in 0.1 s
TICKS = {"802.11a": 60, "802.11b": 180}
KEY = np.uint64(derive_key("fading"))
LAW = fading_model(Fading(), 2.44e9)._replace(wave_number=2.44e9 / 299_792_458.0)


@pytest.mark.parametrize(("radio", "nodes", "payload_bytes", "interval_s", "delivery", "delay_ms"), FIGURES)
def test_contention_delivery_and_delay_match_ns3(
    radio: Radio, nodes: int, payload_bytes: int, interval_s: float, delivery: float, delay_ms: float
):
    measured = contention(radio, nodes, payload_bytes, interval_s, seeds=range(1, 6), measured_s=2.0)
    assert measured.packets == 5 * nodes * 2.0 / interval_s
    assert measured.pdr == pytest.approx(delivery, abs=0.03)
    assert measured.mean_delay_s == pytest.approx(delay_ms / 1e3, rel=0.15)


@pytest.mark.parametrize(("radio", "attempts"), [(CSMA, 4), (DCF_A, 7)], ids=["802.15.4", "802.11a"])
def test_unicast_delivery_under_loss_matches_the_standards_attempts(radio: Radio, attempts: int):
    """1 - loss^attempts: macMaxFrameRetries, 3, counts retries, and dot11ShortRetryLimit, 7, attempts.

    Of 20,000 packets, within four standard errors (1 in 16,000 each).
    """
    arenas, ticks, loss = 100, 200, 0.9
    pose = np.tile(at((0, 0), (1, 0)), (arenas, 1))
    medium = make_medium(replace(radio, loss=loss), 2, range(arenas))
    received = len(run(medium, pose, lambda _: packets(range(0, 2 * arenas, 2), 1), ticks, 2).received("sender_index"))
    share = 1.0 - loss**attempts
    error = (share * (1.0 - share) / (arenas * ticks)) ** 0.5
    assert received / (arenas * ticks) == pytest.approx(share, abs=4.0 * error)


def test_dcf_stations_that_send_at_once_collide():
    measured = contention(replace(DCF_B, send_offset="tick"), 5, 128, 0.1, seeds=[1])
    assert (measured.pdr, measured.mean_delay_s) == (0.0, None)


@pytest.mark.parametrize(
    ("radio", "nodes", "stated"),
    [(A_6M, 2, 0.1176), (A_6M, 5, 0.3939), (B_1M, 2, 0.0606), (B_1M, 5, 0.2213)],
    ids=["a, 2", "a, 5", "b, 2", "b, 5"],
)
def test_dcf_full_queues_collide_as_often_as_theory_says(radio, nodes: int, stated: float):
    """12,000 frames or more, lost in pairs: standard errors of 0.005 at most, so that 0.02 are 4 (1 in 16,000 each)."""
    pose = at(*((0.01 * i, 0.0) for i in range(nodes)))
    sent = packets(np.repeat(np.arange(nodes), PER_TICK[radio.frame]), size=100)
    result = run(make_medium(radio, nodes), pose, lambda _: sent, TICKS[radio.frame])
    fate = result.on_air("fate")
    received, collided = (int(np.count_nonzero(fate == kind)) for kind in (Fate.RECEIVED, Fate.COLLIDED))
    frames = (received + collided) / (nodes - 1)
    window = {"802.11a": 16, "802.11b": 32}[radio.frame]
    assert 1.0 - (1.0 - 2.0 / (window + 1)) ** (nodes - 1) == pytest.approx(stated, abs=5e-5)
    assert frames > 12_000
    assert collided / (received + collided) == pytest.approx(stated, abs=0.02)


def test_fade_rate_and_duration_match_theory():
    """At 1 m/s and 2.44 GHz it falls by 10 dB 5.838 times a second, for 16.3 ms each; over 400 s of 40 pairs.

    Held to 12 %: 2300 fades, which come in runs, give about 3 %, so that is 4 standard errors (1 in 16 000).
    """
    metres = np.arange(0.0, 10.0, 1e-3)
    falls, below = 0, 0
    for a, b in ((pair % 150, 150 + pair // 150) for pair in range(0, 15_000, 375)):
        power = np.array([fading_gain(LAW, KEY, a, b, 3.0, 1.0, x, 2.0 * a) for x in metres])
        deep = power < 0.1
        falls += int(np.sum(deep[1:] & ~deep[:-1]))
        below += int(deep.sum())
    seconds = 40 * 10.0
    assert falls / seconds == pytest.approx(5.838, rel=0.12)
    assert below * 1e-3 / falls == pytest.approx(16.30e-3, rel=0.12)


@pytest.mark.parametrize(
    "others", [{}, {"shadowing": Shadowing(4.0, 5.0), "fading": Fading()}], ids=["plain", "fading"]
)
def test_default_cut_off_raises_delivery_by_less_than_three_percent(others: dict[str, Any]):
    """1,200 robots in four arenas of 100 x 100 m that load the channel to two fifths; the same draws with either."""
    rng = np.random.default_rng(5)
    pose = np.column_stack([rng.uniform(-50.0, 50.0, (1200, 2)), np.zeros(1200)])
    radio, sent = replace(CSMA, antenna=Antenna(-25.0), **others), packets(range(1200), size=40)
    received = [
        run(make_medium(replace(radio, cut_off_db=cut_off_db), 300, range(4)), pose, lambda _: sent, 12, 1)
        .tally.fates[:, Fate.RECEIVED]
        .sum()
        for cut_off_db in (Radio.cut_off_db, 30.0)
    ]
    assert 1.0 < received[0] / received[1] < 1.03

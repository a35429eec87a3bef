"""Rate control of IEEE 802.11n: ideal and AARF."""

from typing import Any

import numpy as np
import pytest

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.radio.config.radio import Radio
from tests.support.comms.radio import Run, at, make_medium, packets, run
from tests.unit.world.scenario.test_bodies import radio_of

SYMBOL_BITS = (26, 52, 78, 104, 156, 208, 234, 260)  # by MCS
NOISE_DBM, POWER_DBM, LOSS_DB = -93.965, 16.0, 40.0  # 20 MHz at 290 K and 7 dB; log-distance, exponent 2
# ns-3's thresholds of IdealWifiManager for its table-based error rates, in dB, by MCS.
IDEAL_DB = (1.465, 4.475, 6.985, 10.375, 13.465, 17.865, 19.125, 20.775)


def radio_n(rate_control: str, **others: Any) -> Radio:
    loss = {"exponent": 2.0, "reference_loss_db": LOSS_DB}
    access = {"rate_control": rate_control}
    return radio_of({"preset": "wifi-n-5G", "send_offset": "tick", "log_distance": loss, "access": access, **others})


def apart(sinr_db: float) -> np.ndarray:
    """Two robots with this SINR between them."""
    return at((0, 0), (10.0 ** ((POWER_DBM - LOSS_DB - NOISE_DBM - sinr_db) / 20.0), 0))


def rates(result: Run) -> list[int]:
    """The MCS of each packet of 1000 bytes, by its airtime."""
    by_us = {36 + 4 * -(-(22 + 8 * 1066) // bits): mcs for mcs, bits in enumerate(SYMBOL_BITS)}
    airtime_us = (result.departed("off_air_at_ns") - result.departed("on_air_at_ns")) // 1000
    order = np.argsort(result.departed("on_air_at_ns"))
    return [by_us[us] for us in airtime_us[order].tolist()]


def one_a_tick(radio: Radio, pose: np.ndarray, ticks: int) -> list[int]:
    return rates(run(make_medium(radio, 2), pose, lambda _: packets([0], 1, 1000), ticks, 2))


@pytest.mark.parametrize("mcs", [4, 5, 6, 7])
def test_ideal_takes_the_highest_rate_for_the_reported_sinr(mcs: int):
    """The first packet has MCS 0, since its receiver has not reported yet; preambles need -82 dBm, 12 dB."""
    above_db = IDEAL_DB[mcs + 1] if mcs < 7 else IDEAL_DB[7] + 3.0
    assert one_a_tick(radio_n("ideal"), apart(0.5 * (IDEAL_DB[mcs] + above_db)), 4) == [0, mcs, mcs, mcs]


@pytest.mark.parametrize("rate_control", ["ideal", "aarf"])
def test_rate_control_exceeds_no_highest_rate(rate_control: str):
    assert max(one_a_tick(radio_n(rate_control, bit_rate_bps=19_500_000), apart(40.0), 35)) == 2


def test_aarf_rises_after_ten_successes_and_falls_back_after_a_failed_probe():
    """At 15 dB MCS 4 passes and MCS 5 fails: a failed probe falls back, and the next rise needs 20 successes."""
    result = one_a_tick(radio_n("aarf"), apart(15.0), 85)
    # A packet whose first attempt failed is seen at the rate of its last one.
    assert result[:50] == [0] * 10 + [1] * 10 + [2] * 10 + [3] * 10 + [4] * 10
    assert max(result) == 4


def test_rate_control_is_refused_with_other_frames():
    with pytest.raises(BadInput) as error:
        radio_of({"preset": "wifi-a-6M", "access": {"rate_control": "ideal"}})
    assert error.value.key == "radio.access.rate_control"

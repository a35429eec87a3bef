"""Contention in one spot as ns-3 3.44 has it: delivery within 0.03, mean delay within 15 %."""

from dataclasses import replace

import pytest

from swarmwire.comms.air.parameters.propagation import Antenna
from swarmwire.comms.air.parameters.reception import Reception
from swarmwire.comms.air.probe.contention import contention
from swarmwire.comms.air.radio import Radio
from swarmwire.comms.air.reception.noise import Noise
from tests.support.comms.air.signal.radios import with_access

CSMA = replace(with_access("csma-802154"), send_offset="uniform", queue_limit=10**6)
DCF_B = replace(
    with_access("dcf"), send_offset="uniform", queue_limit=500, max_payload_bytes=1500, antenna=Antenna(16.0206)
)
DCF_A = replace(
    DCF_B,
    frame="802.11a",
    bit_rate_bps=6_000_000,
    reception=Reception("802.11ag", preamble_sinr_db=4.0, preamble_dbm=-82.0, take_over_s=4e-6),
    noise=Noise(20e6, 7.0),
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


@pytest.mark.parametrize(("radio", "nodes", "payload_bytes", "interval_s", "delivery", "delay_ms"), FIGURES)
def test_delivery_and_delay_are_those_of_ns_3(
    radio: Radio, nodes: int, payload_bytes: int, interval_s: float, delivery: float, delay_ms: float
):
    found = contention(radio, nodes, payload_bytes, interval_s, seeds=range(1, 6), measured_s=2.0)
    assert found.packets == 5 * nodes * 2.0 / interval_s
    assert found.delivery_ratio == pytest.approx(delivery, abs=0.03)
    assert found.mean_delay_s == pytest.approx(delay_ms / 1e3, rel=0.15)


def test_all_who_send_at_once_by_dcf_collide():
    found = contention(replace(DCF_B, send_offset="tick"), 5, 128, 0.1, seeds=[1])
    assert (found.delivery_ratio, found.mean_delay_s) == (0.0, None)

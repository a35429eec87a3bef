"""How long packets wait in a sender's queue: as long as theory says of random arrivals and equal airtimes (M/D/1)."""

from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.air.disk.queue import ACCEPTED, enter
from swarmwire.comms.air.parameters.access import Access
from swarmwire.comms.air.radio import Radio
from tests.support.comms.air.runs import at, make_air, packets, run
from tests.support.comms.air.signal.radios import with_access

AIRTIME_NS = 1_000_000
SENDERS, WARM_UP, PACKETS = 1500, 150, 400
STANDARD_ERRORS = 4.4
NOBODY = np.empty(0, np.int64)


@pytest.mark.parametrize(("load", "stated"), [(0.5, 0.5), (0.8, 2.0), (0.9, 4.5)])
def test_packets_that_come_at_random_wait_as_theory_says(load: float, stated: float):
    """Mean wait rho / (2 (1 - rho)) airtimes; 4.4 standard errors over independent senders (1 in 90,000).

    At a load of 0.9 a queue forgets that it was empty in some 100 airtimes, which the warm-up leaves out.
    """
    gaps_ns = np.random.default_rng(7).exponential(AIRTIME_NS / load, (WARM_UP + PACKETS, SENDERS))
    sent_at_ns = np.cumsum(gaps_ns, axis=0).astype(np.int64)
    free_at_ns, wait = np.zeros(SENDERS, np.int64), np.zeros(SENDERS)
    sender, airtime_ns, fits = np.arange(SENDERS), np.full(SENDERS, AIRTIME_NS), np.zeros(SENDERS, bool)
    for k, at_ns in enumerate(sent_at_ns):
        on_air_at_ns, fate, free_at_ns = enter(
            at_ns, free_at_ns, NOBODY, NOBODY, sender, airtime_ns, fits, np.full(len(free_at_ns), 10**9)
        )
        assert (fate == ACCEPTED).all()
        if k >= WARM_UP:
            wait += (on_air_at_ns - at_ns) / AIRTIME_NS / PACKETS
    assert load / (2.0 * (1.0 - load)) == pytest.approx(stated, rel=1e-12)
    assert abs(wait.mean() - stated) < STANDARD_ERRORS * wait.std() / np.sqrt(SENDERS)


def test_a_radio_with_signals_has_the_disks_queue():
    """Without access there is nothing else to wait for: the same packets go on air at the same instants."""
    signals = replace(with_access("none"), send_offset="uniform", bit_rate_bps=20_000, queue_limit=3)
    assert signals.access == Access("none")
    disk = Radio(
        9.0,
        bit_rate_bps=20_000,
        overhead_bytes=signals.overhead_bytes,
        max_payload_bytes=signals.max_payload_bytes,
        queue_limit=3,
    )
    found = []
    for radio in (signals, disk):
        draws = np.random.default_rng(3)
        told = run(
            make_air(radio, 3),
            at((0, 0), (1, 0), (0, 1)),
            lambda _, draws=draws: packets(draws.integers(0, 3, 20), size=draws.integers(1, 100, 20)),
            20,
            30,
        )
        columns = [told.finished(name) for name in ("sender", "sequence", "receiver", "on_air_at_ns", "fate")]
        found.append(sorted(zip(*(column.tolist() for column in columns), strict=True)))
    assert len({row[3] for row in found[0]}) > 50
    assert found[0] == found[1]

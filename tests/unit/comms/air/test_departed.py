"""Every packet leaves its sender's radio once, and its receivers are those of the tally."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmwire.comms.air.radio import Radio
from swarmwire.comms.fates import Fate
from swarmwire.comms.packets import BROADCAST
from tests.support.comms.air.runs import Run, at, make_air, packets, run, scattered
from tests.support.comms.air.signal.radios import METHODS, with_access
from tests.unit.comms.air.test_accounts import OBSTACLES, RADIOS, random_traffic


def told(run: Run, name: str):
    return np.concatenate([getattr(one.departed, name) for one in run.news])


def check_packets(ended: Run) -> None:
    """Of packets that all have left: once each, intended and out of range as the tally has them."""
    packet = Counter(zip(*(told(ended, name).tolist() for name in ("arena", "sender", "sequence")), strict=True))
    assert set(packet.values()) <= {1}
    tally = ended.tally
    assert len(packet) == tally.sent.sum()
    assert told(ended, "intended").sum() == tally.intended.sum()
    assert told(ended, "out_of_range").sum() == tally.fates[:, Fate.OUT_OF_RANGE].sum()
    never, on, off = told(ended, "fate") != Fate.HEARD, told(ended, "on_air_at_ns"), told(ended, "off_air_at_ns")
    assert (off >= on).all()
    assert (off == on)[never].all()


@settings(max_examples=60)
@given(RADIOS, st.integers(1, 3), st.integers(2, 12), st.integers(0, 1000))
def test_each_packet_departs_once_over_a_disk(radio: Radio, arenas: int, robots: int, seed: int):
    rng = np.random.default_rng(seed)
    air = make_air(replace(radio, bit_rate_bps=250_000), robots, range(arenas), [OBSTACLES] * arenas)
    pose = scattered(arenas * robots, seed)
    check_packets(run(air, pose, lambda _: random_traffic(rng, arenas, robots), 4, 8))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("seed", range(5))
def test_each_packet_departs_once_over_signals_acknowledged_or_not(method: str, seed: int):
    rng = np.random.default_rng(seed)
    ended = run(
        make_air(with_access(method), 6, range(2)), scattered(12, seed), lambda _: random_traffic(rng, 2, 6), 4, 8
    )
    check_packets(ended)


def test_a_packet_tells_whom_it_was_for_and_how_long_it_was_on_air():
    radio = Radio(range_m=1.0, bit_rate_bps=8_000, send_offset="tick", queue_limit=0)
    sent = packets([0, 2, 2], [BROADCAST, 1, BROADCAST], 20)
    ended = run(make_air(radio, 3), at((0, 0), (0.5, 0), (2, 0)), lambda tick: sent if tick == 0 else packets([]), 1, 1)
    columns = ("sender", "to", "intended", "out_of_range", "fate", "on_air_at_ns", "off_air_at_ns")
    rows = sorted(zip(*(told(ended, name).tolist() for name in columns), strict=True))
    airtime_ns = 20_000_000
    assert rows == [
        (0, BROADCAST, 2, 1, Fate.HEARD, 0, airtime_ns),
        (2, BROADCAST, 2, 0, Fate.QUEUE_FULL, 0, 0),
        (2, 1, 1, 1, Fate.HEARD, 0, airtime_ns),
    ]

"""With `keep_order`, no packet overtakes another of its link, and nothing else changes."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmwire.comms.air.disruption import Disruption
from swarmwire.comms.air.parameters.delays import Delays
from swarmwire.comms.air.radio import Radio
from swarmwire.comms.arrays import IntArray
from swarmwire.comms.clock import tick_start_ns
from tests.support.comms.air.runs import RATE_HZ, TICK_NS, everybody, make_air, packets, run, scattered
from tests.support.comms.air.signal.radios import with_access
from tests.unit.comms.air.test_accounts import random_traffic

LATE = Delays("lognormal", 0.15, 0.2)
DISK = Radio(4.0, loss=0.1, jitter_s=0.1, delays=LATE)
RADIOS = (DISK, *(replace(with_access(method), delays=LATE) for method in ("none", "csma-802154")))
ROBOTS, ARENAS, TICKS = 5, 2, 6


def kept(radio: Radio) -> Radio:
    """The radio, with the order kept."""
    assert radio.delays is not None
    return replace(radio, delays=replace(radio.delays, keep_order=True))


def heard(radio: Radio, seed: int, between: Sequence[float] = ()) -> IntArray:
    """Receiver, sender, sequence and time of all that is heard, as it is told, (k, 4).

    `between` are moments, as shares of a tick, at which the air is asked, too.
    """
    rng = np.random.default_rng(seed)
    air = make_air(radio, ROBOTS, range(ARENAS))
    pose, alive = scattered(ARENAS * ROBOTS, seed), np.ones(ARENAS * ROBOTS, np.bool_)
    told = []
    for tick in range(TICKS + 40):
        at_ns = tick_start_ns(tick, RATE_HZ)
        told.append(air.advance(at_ns).heard)
        air.hold(pose, alive)
        if tick < TICKS:
            air.send(at_ns, tick, random_traffic(rng, ARENAS, ROBOTS))
        told += [air.advance(at_ns + int(share * TICK_NS)).heard for share in between]
    return np.concatenate([np.stack([h.receiver, h.sender, h.sequence, h.heard_at_ns], axis=1) for h in told])


def sorted_rows(found: IntArray) -> Any:
    return found[np.lexsort(found.T)].tolist()


def overtaken(found: IntArray) -> int:
    """How many packets are heard before one of their link with a smaller number."""
    count = 0
    for link in np.unique(found[:, :2], axis=0):
        count += int(np.count_nonzero(np.diff(found[(found[:, :2] == link).all(axis=1), 2]) < 0))
    return count


@pytest.mark.parametrize("radio", RADIOS)
def test_packets_overtake_unless_order_is_kept(radio: Radio):
    free, ordered = heard(radio, 3), heard(kept(radio), 3)
    assert overtaken(free) > 10
    assert overtaken(ordered) == 0
    # The same packets, each as late as the latest up to it on its link.
    expected = free[np.lexsort((free[:, 2], free[:, 1], free[:, 0]))]
    for i in range(1, len(expected)):
        if (expected[i, :2] == expected[i - 1, :2]).all():
            expected[i, 3] = max(expected[i, 3], expected[i - 1, 3])
    assert sorted_rows(ordered) == sorted_rows(expected)


@settings(max_examples=25)
@given(
    st.sampled_from(RADIOS), st.integers(0, 1000), st.lists(st.floats(0.0, 0.999), min_size=1, max_size=3).map(sorted)
)
def test_when_the_air_is_asked_changes_nothing(radio: Radio, seed: int, between: list[float]):
    at_ticks, often = heard(kept(radio), seed), heard(kept(radio), seed, between)
    assert overtaken(often) == 0
    assert sorted_rows(at_ticks) == sorted_rows(often)


def test_a_reception_that_an_event_ended_holds_up_nothing():
    """The radio of robot 0 is off while first packets are on their way to it; second ones come in their own time."""
    radio = Radio(9.0, send_offset="tick", delays=Delays("uniform", 0.5, 0.28))
    times: list[dict[tuple[int, int], int]] = []
    for one in (radio, kept(radio)):
        air, pose = make_air(one, 12), scattered(12)
        times.append({})
        for tick in range(14):
            now = Disruption.none(12)
            now.radio_on[0] = tick != 1
            air.disrupt(now)
            at_ns = tick_start_ns(tick, RATE_HZ)
            told = air.advance(at_ns).heard
            times[-1] |= {
                (s, q): t
                for r, s, q, t in zip(told.receiver, told.sender, told.sequence, told.heard_at_ns, strict=True)
                if r == 0
            }
            air.hold(pose, np.ones(12, np.bool_))
            if tick in (0, 2):
                air.send(at_ns, tick, packets(range(1, 12)))
    free, ordered = times
    ended = [sender for sender in range(1, 12) if (sender, 0) not in free]
    assert len(ended) > 5
    assert [ordered[sender, 1] for sender in ended] == [free[sender, 1] for sender in ended]
    assert ordered.keys() == free.keys()


def test_nobody_waits_where_delays_are_even():
    radio = Radio(9.0, latency_s=0.2, delays=Delays("uniform", 0.01, 1e-9))
    pose = scattered(4)
    free, ordered = (run(make_air(one, 4), pose, everybody(4), 4, 4) for one in (radio, kept(radio)))
    np.testing.assert_array_equal(free.heard("heard_at_ns"), ordered.heard("heard_at_ns"))

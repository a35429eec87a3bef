"""In how many parts time passes within a tick changes nothing of what becomes of packets."""

from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmwire.comms.air.air import Air
from swarmwire.comms.air.disruption import Disruption
from swarmwire.comms.air.news import News
from swarmwire.comms.air.radio import Radio
from swarmwire.comms.clock import tick_start_ns
from swarmwire.comms.packets import Heard
from tests.support.comms.air.runs import RATE_HZ, TICK_NS, make_air, packets, scattered
from tests.support.comms.air.signal.radios import METHODS, with_access
from tests.unit.comms.air.test_accounts import RADIOS

ROBOTS, TICKS = 6, 5
SIGNALS = st.sampled_from(METHODS).map(with_access)


def told(news: list[News]) -> list[Any]:
    """All that was told, whenever that was: as plain values, sorted."""
    out = []
    for one in news:
        h, f, d = one.heard, one.finished, one.departed
        for i in range(len(h)):
            given = tuple(float(column[i]) for column in h.given.values())
            numbers = int(h.receiver[i]), int(h.sender[i]), int(h.sequence[i]), int(h.heard_at_ns[i])
            out.append(("heard", *numbers, given, h.payloads.row(int(h.payload[i]))))
        columns = f.sender, f.receiver, f.receivers, f.sequence, f.on_air_at_ns, f.final_at_ns, f.fate
        out += [("finished", *row) for row in zip(*(column.tolist() for column in columns), strict=True)]
        columns = d.sender, d.sequence, d.intended, d.fate, d.on_air_at_ns, d.off_air_at_ns
        out += [("departed", *row) for row in zip(*(column.tolist() for column in columns), strict=True)]
    return sorted(out)


def played(air: Air, parts: list[float], seed: int, out: int | None) -> tuple[list[Any], list[int]]:
    """What becomes of packets sent at several times within ticks, where time passes in these parts of a tick, too.

    Where robots are out, one is dead and one's radio is off for two ticks. What is heard by a tick's start is told
    before that: a robot that has been handed a packet has heard it, though it be dead a moment later.
    """
    rng = np.random.default_rng(seed)
    pose, alive = scattered(ROBOTS, seed), np.ones(ROBOTS, np.bool_)
    news, within = list[News](), list[Heard]()
    for tick in range(TICKS):
        start_ns = tick_start_ns(tick, RATE_HZ)
        if out is not None and tick in (1, 3):
            off = Disruption.none(ROBOTS)
            if tick == 1:
                off.radio_on[out] = off.alive[(out + 1) % ROBOTS] = False
            air.disrupt(off)
            alive = off.alive.copy()
        within.append(air.advance_within(start_ns)[0])
        news.append(air.advance(start_ns))
        air.hold(pose, alive)
        sends = [(start_ns + int(at), rng.integers(0, ROBOTS, 3)) for at in sorted(rng.integers(0, TICK_NS, 3))]
        looks = [(start_ns + round(part * TICK_NS), None) for part in parts]
        for at_ns, sender in sorted(sends + looks, key=lambda one: (one[0], one[1] is None)):
            if sender is None:
                within.append(air.advance_within(at_ns)[0])
            else:
                air.send_at(np.full(ROBOTS, at_ns), packets(sender, size=12))
    within.append(air.advance_within(tick_start_ns(TICKS, RATE_HZ))[0])
    news.append(air.advance(tick_start_ns(TICKS, RATE_HZ)))
    last = air.end()
    tallies = sum((one.tally for one in news[1:]), news[0].tally) + last
    assert tallies.fates.sum() == tallies.intended.sum()
    assert sum(map(len, within)) == sum(len(one.heard) for one in news)  # each is handed over once
    return told(news), [int(count.sum()) for count in (tallies.sent, tallies.intended, tallies.in_range)]


@settings(max_examples=60, deadline=None)
@given(
    RADIOS | SIGNALS,
    st.lists(st.floats(0.0, 1.0), max_size=12).map(sorted),
    st.integers(0, 1000),
    st.none() | st.integers(0, ROBOTS - 1),
)
def test_time_may_pass_in_any_parts(radio: Radio, parts: list[float], seed: int, out: int | None):
    assert played(make_air(radio, ROBOTS), parts, seed, out) == played(make_air(radio, ROBOTS), [], seed, out)

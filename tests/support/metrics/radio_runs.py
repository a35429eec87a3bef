"""Ticks as a real air tells them: random traffic among robots that walk and die, over disks and over signals."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from hypothesis import strategies as st

from swarmwire.comms.clock import tick_start_ns
from swarmwire.comms.radio.config.phy import Access
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.disruption import Disruption
from swarmwire.comms.truth import Static, Truth
from tests.support.comms.radio.phy.radios import with_access
from tests.support.comms.radio.runs import make_medium, scattered
from tests.support.metrics.truths import static, truth
from tests.unit.comms.radio.test_accounts import OBSTACLES, random_traffic

DISK = Radio(range_m=2.0, loss=0.2, latency_s=0.15, jitter_s=0.1, bit_rate_bps=20_000, queue_limit=2)
RADIOS = (
    DISK,
    replace(DISK, bit_rate_bps=2_000, latency_s=0.0),  # packets outlast ticks
    replace(with_access("none"), bit_rate_bps=20_000, jitter_s=0.1),
    replace(with_access("aloha"), bit_rate_bps=2_000),
    replace(with_access("dcf"), access=Access("dcf", acknowledged=False)),
)


def ticks(radio: Radio, of: Static, seed: int, count: int = 12) -> Iterator[Truth]:
    """So many ticks in the loop's order; a robot dies in the midst, and lives again."""
    rng = np.random.default_rng(seed)
    rows = of.arenas * of.robots
    medium = make_medium(radio, of.robots, of.seeds, [OBSTACLES] * of.arenas)
    pose, states = scattered(rows, seed), Disruption.none(rows)
    for tick in range(count):
        at_ns = tick_start_ns(tick, of.rate_hz)
        alive = np.ones(rows, np.bool_)
        alive[0] = not count // 3 <= tick < 2 * count // 3
        pose = pose + rng.normal(0.0, 0.2, pose.shape)
        news = medium.step(at_ns, pose, replace(states, alive=alive))
        sent = random_traffic(rng, of.arenas, of.robots)
        living = np.flatnonzero(alive[sent.sender])
        sent = replace(sent, sender=sent.sender[living], to=sent.to[living], payloads=sent.payloads.rows(living))
        medium.send(at_ns, tick, sent)
        yield truth(of, tick, pose=pose, alive=alive, tally=news.tally, finished=news.finished, departed=news.departed)


@st.composite
def radio_runs(draw: st.DrawFn) -> tuple[Static, list[Truth]]:
    """A run of any of the radios."""
    of = static(robots=draw(st.integers(2, 7)), arenas=draw(st.integers(1, 3)))
    return of, list(ticks(draw(st.sampled_from(RADIOS)), of, draw(st.integers(0, 1000))))


def rows_of(table, *columns):
    """A table's rows as plain numbers, of these columns."""
    return list(zip(*(getattr(table, name).tolist() for name in columns), strict=True))

"""Senders that always have a packet collide as often as the theory of saturated DCF says.

Each sends in a slot with 2 / (W + 1), W = CW + 1 slots, and frames to all never double the window: a frame is alone
with (1 - 2 / (W + 1))^(n - 1) (G. Bianchi, IEEE J. Sel. Areas Comm. 18, 2000, without retries). Few nodes, as theory
leaves out that slots freeze. Keys are fixed.
"""

from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.air.parameters.reception import Reception
from swarmwire.comms.air.reception.noise import Noise
from swarmwire.comms.fates import Fate
from tests.support.comms.air.runs import at, make_air, packets, run
from tests.support.comms.air.signal.radios import with_access

B_1M = replace(with_access("dcf"), queue_limit=500)
A_6M = replace(
    B_1M,
    frame="802.11a",
    bit_rate_bps=6_000_000,
    noise=Noise(20e6, 7.0),
    reception=Reception("802.11ag", preamble_sinr_db=4.0, preamble_dbm=-82.0, take_over_s=4e-6),
)
PER_TICK = {"802.11a": 200, "802.11b": 40}  # more than there is time for in 0.1 s
TICKS = {"802.11a": 60, "802.11b": 180}


@pytest.mark.parametrize(
    ("radio", "nodes", "stated"),
    [(A_6M, 2, 0.1176), (A_6M, 5, 0.3939), (B_1M, 2, 0.0606), (B_1M, 5, 0.2213)],
    ids=["a, 2", "a, 5", "b, 2", "b, 5"],
)
def test_full_queues_collide_as_often_as_theory_says(radio, nodes: int, stated: float):
    """12,000 frames or more, lost in pairs: standard errors of 0.005 at most, so that 0.02 are 4 (1 in 16,000 each)."""
    pose = at(*((0.01 * i, 0.0) for i in range(nodes)))
    sent = packets(np.repeat(np.arange(nodes), PER_TICK[radio.frame]), size=100)
    told = run(make_air(radio, nodes), pose, lambda _: sent, TICKS[radio.frame])
    fate = told.on_air("fate")
    heard, collided = (int(np.count_nonzero(fate == kind)) for kind in (Fate.HEARD, Fate.COLLIDED))
    frames = (heard + collided) / (nodes - 1)
    window = {"802.11a": 16, "802.11b": 32}[radio.frame]
    assert 1.0 - (1.0 - 2.0 / (window + 1)) ** (nodes - 1) == pytest.approx(stated, abs=5e-5)
    assert frames > 12_000
    assert collided / (heard + collided) == pytest.approx(stated, abs=0.02)

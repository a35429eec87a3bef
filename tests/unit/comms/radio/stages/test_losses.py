"""Losses: one implementation for both radio models.

Keys are fixed. Shares are held to 4.4 standard errors, a false alarm of 1 in 90 000 each.
"""

from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.radio.config.impairments import Bursts
from swarmwire.comms.radio.config.radio import Radio, Trace
from swarmwire.comms.radio.stages.losses import LOSS_MODELS
from swarmwire.comms.radio.traces import LinkTraces
from tests.support.comms.radio.measured import TRIO, trace_of
from tests.support.comms.radio.phy.radios import with_access
from tests.support.comms.radio.runs import Run, at, everybody, make_medium, run

POSE = at((0, 0), (1, 0), (0, 1))
RATIOS = LinkTraces(
    delivery_ratio=trace_of(
        "delivery_ratio", [(0, s, r, 0.3 + 0.1 * s + 0.2 * r) for s in range(3) for r in range(3) if s != r]
    )
)
LOSSES = {
    "fixed_loss": {"loss": 0.4},
    "burst_loss": {"bursts": Bursts(0.3, 0.6, 0.9, 0.1)},
    "trace_loss": {"trace": Trace("a.csv", "none")},
}
# Frames of the same airtime, in radios in which nothing else is lost.
PHY = replace(with_access("none"), send_offset="tick")
DISK = Radio(
    9.0, bit_rate_bps=PHY.bit_rate_bps, overhead_bytes=PHY.overhead_bytes, max_payload_bytes=110, send_offset="tick"
)


def replayed(radio: Radio, ticks: int, pose: FloatArray = POSE) -> Run:
    """Everybody broadcasts in each tick."""
    traces = None if radio.trace is None else RATIOS
    return run(make_medium(radio, TRIO, range(2), traces=traces), np.tile(pose, (2, 1)), everybody(2 * TRIO), ticks, 2)


def received(told: Run) -> set[tuple[int, int, int]]:
    """Sender, receiver and sequence number of what was received."""
    return set(zip(*(told.received(name).tolist() for name in ("sender", "receiver", "sequence")), strict=True))


def test_every_loss_model_is_tried_here():
    assert set(LOSSES) == {kind.name for kind in LOSS_MODELS}


@pytest.mark.parametrize("name", LOSSES)
def test_both_radio_models_lose_the_same_frames(name: str):
    disk, phy = (replayed(replace(radio, **LOSSES[name]), 40) for radio in (DISK, PHY))
    assert received(disk) == received(phy)
    assert disk.fates() == phy.fates()
    assert 100 < disk.fates()["RECEIVED"] < 400


@pytest.mark.parametrize("radio", [DISK, PHY], ids=["unit disk", "PHY"])
@pytest.mark.parametrize("name", LOSSES)
def test_the_radio_graph_counts_each_loss(name: str, radio: Radio):
    """Each pair is joined up to the delivery of its worse direction: 0.6, 0.57 or by the trace 0.4 to 0.7."""
    bursts = LOSSES["burst_loss"]["bursts"]
    worse = {"fixed_loss": [0.6] * 3, "burst_loss": [1.0 - bursts.loss] * 3, "trace_loss": [0.4, 0.5, 0.7]}[name]
    for enough in (0.3, 0.45, 0.55, 0.65, 0.9):
        lossy = replace(radio, min_delivery=enough, **LOSSES[name])
        medium = make_medium(lossy, TRIO, traces=RATIOS if lossy.trace else None)
        joined = [pair for pair, delivery in zip([[0, 1], [0, 2], [1, 2]], worse, strict=True) if delivery >= enough]
        assert medium.step(0, POSE).edges.tolist() == joined

"""Bursts: when some links are bad, and how long runs of lost packets are."""

# pyright: basic, reportUnknownMemberType=false

from typing import Any

import numpy as np

from docs.pictures.radio.sheet import legend, line_color, panels, set_labels, write
from swarmwire.comms.base.arrays import BoolArray
from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.draws import derive_key
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.radio.config.impairments import Bursts
from swarmwire.comms.radio.links import RECEIVED
from swarmwire.comms.radio.stages.burst_loss import BurstLoss
from swarmwire.comms.radio.stages.link_draws import ReceivedFrame
from swarmwire.comms.radio.stages.losses import AT_FRAME_NS, LossChain, frame_fate
from swarmwire.metrics.real.radio_fit.losses import expected_runs

BURSTS = Bursts(bad_s=0.5, good_s=2.0)
ROBOTS, INTERVAL_S = 20, 0.1
SHOWN, SHOWN_PACKETS = 4, 300
PACKETS, LONGEST = 2000, 30


def draw() -> None:
    """Write bursts.svg."""
    lost = losses(PACKETS)
    figure, (time, runs) = panels(2, 2.6, (1.35, 1.0))
    for row in range(SHOWN):
        at = np.flatnonzero(lost[row + 1, :SHOWN_PACKETS]) * INTERVAL_S
        time.broken_barh([(s, INTERVAL_S) for s in at], (SHOWN - row - 0.35, 0.7), facecolors=[line_color(row)], lw=0)
    time.set_yticks(range(1, SHOWN + 1), [f"0 to {SHOWN - row}" for row in range(SHOWN)])
    time.set_xlim(0.0, SHOWN_PACKETS * INTERVAL_S)
    time.grid(visible=False, axis="y")
    set_labels(time, "when links are bad: 0.5 s at a time, good for 2 s", "time in s", "from robot to robot")
    lengths = run_lengths(lost)
    counts = np.bincount(np.minimum(lengths, LONGEST + 1), minlength=LONGEST + 2)[1 : LONGEST + 1]
    at = np.arange(1, LONGEST + 1)
    runs.plot(at, expected_runs(BURSTS, INTERVAL_S, LONGEST), color=line_color(0), lw=1.4, label="geometric")
    runs.plot(at, counts / len(lengths), "o", ms=3, color=line_color(1), label=f"{len(lengths)} runs")
    runs.set_yscale("log")
    set_labels(runs, "runs of lost packets, one each 0.1 s", "length in packets", "share of runs")
    legend(runs, "upper right")
    write(figure, "bursts")


def losses(packets: int) -> BoolArray:
    """Which packets of each link are lost, (links, packets)."""
    chain, keys = LossChain([BurstLoss(BURSTS, ROBOTS)]), np.array([derive_key("figure of bursts")], np.uint64)
    links = ROBOTS * ROBOTS
    sender, receiver = np.divmod(np.arange(links), ROBOTS)
    lost = np.empty((links, packets), np.bool_)
    for n in range(packets):
        at_ns = round(n * INTERVAL_S * NS_PER_S)
        lose(lost[:, n], chain.losses(AT_FRAME_NS, at_ns, links), keys[0], sender, receiver, n, at_ns)
    return lost


@njit()
def lose(lost: Any, losses: Any, key: int, sender: Any, receiver: Any, sequence: int, at_ns: int) -> None:
    """Write whether a packet of each link is lost, (links,)."""
    for i in range(len(lost)):
        s, r = sender[i], receiver[i]
        frame = ReceivedFrame(key, s, r, s, r, sequence, 0, False, at_ns, at_ns)
        lost[i] = frame_fate(losses, frame) != RECEIVED


def run_lengths(lost: BoolArray) -> np.ndarray:
    """Lengths of runs that begin after the first packet and well before the last, so that long ones are not cut."""
    edges = np.diff(np.pad(lost.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    begins, ends = np.nonzero(edges == 1)[1], np.nonzero(edges == -1)[1]
    return (ends - begins)[(begins > 0) & (begins < lost.shape[1] - 200)]

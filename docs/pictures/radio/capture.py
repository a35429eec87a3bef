"""Capture: how often a frame is received though another is on air, over the ratio of the two."""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import replace

import numpy as np

from benchmarks.ns3.configurations import radio_like_ns3
from docs.pictures.radio.sheet import legend_below, line_color, panels, set_labels, write
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.draws import derive_key
from swarmwire.comms.radio.config.phy import Access
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.radio.propagation.path_loss import reach_m
from swarmwire.comms.robot.packets import Fate, Payloads, SentPackets

WANTED_LOSS_DB = 70.0
SIR_DB = np.arange(-8.0, 12.1, 0.5)
PAYLOAD_BYTES, ARENAS, FRAMES = 40, 20, 20
PAIR_NS, LATER_NS = 20_000_000, 50_000  # between two pairs of frames, and between the frames of a pair
CASES = {"it begins first": -1, "both begin at once": 0, "it begins second": 1}
TECHNOLOGIES = {
    "802.15.4": ("802.15.4", 0.25),
    "802.11a 6 Mbit/s": ("802.11a", 6.0),
    "802.11b 1 Mbit/s": ("802.11b", 1.0),
}


def draw() -> None:
    """Write capture.svg."""
    figure, row = panels(len(TECHNOLOGIES), 2.7)
    for axes, (technology, kind) in zip(row, TECHNOLOGIES.items(), strict=True):
        radio = replace(radio_like_ns3(*kind), access=Access("aloha"), send_offset="tick")
        for index, (name, order_of_start) in enumerate(CASES.items()):
            received = [share_received(radio, float(sir_db), order_of_start) for sir_db in SIR_DB]
            axes.plot(SIR_DB, received, color=line_color(index), lw=1.4, label=name)
        axes.set_ylim(-0.03, 1.05)
        axes.set_xlim(SIR_DB[0], SIR_DB[-1])
        set_labels(
            axes,
            technology,
            "signal over the other's, in dB",
            "share of frames that are received" if axes is row[0] else "",
        )
    legend_below(figure, row[0], 3)
    write(figure, "capture")


def share_received(radio: Radio, sir_db: float, order_of_start: int) -> float:
    """How many of the frames of robot 0 robot 2 hears, while robot 1 sends, too."""
    curve = radio.path_loss_model.curve(radio.frequency_hz)
    wanted_m, other_m = (float(reach_m(curve, loss_db)) for loss_db in (WANTED_LOSS_DB, WANTED_LOSS_DB + sir_db))
    keys = np.array([derive_key("figure of capture", arena) for arena in range(ARENAS)], np.uint64)
    medium = RadioMedium(ChannelContext.open_space(radio, keys, 3, (100.0, 100.0)), 1)
    pose = np.tile([[wanted_m, 0.0, 0.0], [0.0, other_m, 0.0], [0.0, 0.0, 0.0]], (ARENAS, 1))
    received = 0
    for frame in range(FRAMES):
        for sender, at_ns in order(order_of_start, frame * PAIR_NS):
            received += decided(medium, at_ns, pose)
            rows = 3 * np.arange(ARENAS) + sender
            payloads = Payloads.from_rows([bytes(PAYLOAD_BYTES)] * ARENAS)
            medium.send(at_ns, frame, SentPackets(rows, np.full(ARENAS, 2), payloads))
    received += decided(medium, FRAMES * PAIR_NS, pose)
    return received / (ARENAS * FRAMES)


def order(order_of_start: int, at_ns: int) -> list[tuple[int, int]]:
    """Who sends when: robot 0 before robot 1, with it, or after it."""
    return sorted(
        [(0, at_ns + LATER_NS * (order_of_start > 0)), (1, at_ns + LATER_NS * (order_of_start < 0))],
        key=lambda frame: frame[1],
    )


def decided(medium: RadioMedium, until_ns: int, pose: FloatArray) -> int:
    """How many frames of robot 0 were received."""
    done = medium.step(until_ns, pose).finished
    return int(np.count_nonzero((done.sender == 0) & (done.fate == Fate.RECEIVED)))

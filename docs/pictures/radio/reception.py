"""Reception: the share of frames that are right, over signal to noise, by standard and rate."""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Sequence
from typing import Any

import numpy as np

from docs.pictures.radio.sheet import line_color, panels, set_labels, write
from swarmwire.comms.radio.propagation.decibels import from_db
from swarmwire.comms.radio.reception import error_rates
from swarmwire.comms.radio.reception.receiver import (
    Receiver,
    chunk_success,
    ieee80211ag,
    ieee80211b,
    ieee802154,
    sinr_for_db,
)
from swarmwire.comms.radio.timing import DSSS_RATES_BPS

POINTS = 141
OCTETS_154, OCTETS_B, OCTETS_AG = (20, 40, 127), 1024, 1000


def draw() -> None:
    """Write reception.svg."""
    figure, (short, dsss_axes, ofdm_axes) = panels(3, 2.7, (1.0, 1.0, 1.4))
    receivers = [(str(octets), ieee802154(), 8 * octets) for octets in OCTETS_154]
    _draw(short, receivers, (-5.0, 3.0))
    set_labels(short, "802.15.4, by octets", "SINR in dB", "share of frames that are right")
    receivers = [(f"{rate / 1e6:g}", ieee80211b(rate), 8 * OCTETS_B) for rate in DSSS_RATES_BPS]
    _draw(dsss_axes, receivers, (-6.0, 10.0))
    set_labels(dsss_axes, f"802.11b, {OCTETS_B} octets, by Mbit/s", "SINR in dB", "")
    receivers = [(f"{rate / 1e6:g}", ieee80211ag(rate), 8 * OCTETS_AG) for rate in error_rates.OFDM_RATES_BPS]
    _draw(ofdm_axes, receivers, (-2.0, 22.0))
    set_labels(ofdm_axes, f"802.11a/g, {OCTETS_AG} octets, by Mbit/s", "SINR in dB", "")
    write(figure, "reception")


def _draw(axes: Any, receivers: Sequence[tuple[str, Receiver, int]], ends_db: tuple[float, float]) -> None:
    """Curves with their names above them, every other one higher where two would touch."""
    sinr_db = np.linspace(*ends_db, POINTS)
    for index, (label, receiver, bits) in enumerate(receivers):
        success = [chunk_success(receiver, from_db(db), bits) for db in sinr_db]
        axes.plot(sinr_db, success, color=line_color(index), lw=1.4)
        at_db = sinr_for_db(receiver, 0.5, bits)
        axes.text(at_db, 1.03 + 0.07 * (index % 2), label, fontsize=7, ha="center", color=line_color(index))
    axes.set_xlim(*ends_db)
    axes.set_ylim(-0.03, 1.18)
    axes.set_yticks(np.linspace(0.0, 1.0, 6))

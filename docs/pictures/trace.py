"""Draws docs/dev/validation/trace.svg: delivery of nodes that move by a trace, beside ns-3's record."""

# pyright: basic, reportUnknownMemberType=false

from pathlib import Path

import numpy as np

from benchmarks.ns3.trace import BIN_M, BIN_S, BY_DISTANCE, BY_DISTANCE_M, NEAR, deliveries, ours, recorded_trace
from docs.pictures.radio.sheet import legend, line_color, panels, set_labels
from swarmwire.comms.radio.config.radio import POSITIONS
from swarmwire.metrics.pictures.drawing.canvas import INK, save

TO = Path(__file__).parents[1] / "dev" / "validation" / "trace.svg"


def draw(to: Path = TO) -> None:
    """Write the figure."""
    ns3, both = recorded_trace().deliveries, {positions: deliveries(ours(positions)) for positions in POSITIONS}
    figure, (over_time, off, over_distance) = panels(3, 2.6)
    at_s = BIN_S * (np.arange(len(ns3[NEAR])) + 0.5)
    at_m = BY_DISTANCE_M[0] + BIN_M * (np.arange(len(ns3[BY_DISTANCE])) + 0.5)
    for index, (positions, figures) in enumerate(both.items()):
        color = line_color(index)
        over_time.plot(at_s, figures[NEAR], color=color, lw=1.2)
        off.plot(at_s, figures[NEAR] - ns3[NEAR], color=color, lw=1.2, label=positions)
        over_distance.plot(at_m, figures[BY_DISTANCE], color=color, lw=1.2, label=positions)
    over_time.plot(at_s, ns3[NEAR], "x", ms=3.5, color=INK)
    over_distance.plot(at_m, ns3[BY_DISTANCE], "x", ms=5, color=INK, label="ns-3")
    over_time.set_ylim(0.0, 1.05)
    off.set_ylim(-0.02, 0.02)
    set_labels(over_time, f"bins of {NEAR}", "time in s", "delivery")
    set_labels(off, "the same, ours - ns-3", "time in s", "difference of delivery")
    set_labels(over_distance, f"bins of {BIN_M:g} m of distance", "distance in m", "delivery")
    legend(off, "upper right")
    legend(over_distance, "lower left")
    save(figure, to)


if __name__ == "__main__":
    draw()

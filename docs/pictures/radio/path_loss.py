"""Path loss over distance by every model, and where two rays cross over."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from docs.pictures.radio.sheet import legend, line_color, panels, set_labels, write
from swarmwire.comms.radio.config.path_loss_models import Friis, ItuIndoor, LogDistance, TwoRay
from swarmwire.comms.radio.propagation.path_loss import loss_db

FREQUENCY_HZ = 2.44e9
MODELS = {
    "two-ray, antennas at 1 m": TwoRay(1.0, 1.0),
    "two-ray, antennas at 0.2 m": TwoRay(0.2, 0.2),
    "Friis": Friis(),
    "log-distance, n = 3.5": LogDistance(3.5),
    "ITU-R P.1238, office": ItuIndoor("office"),
    "ITU-R P.1238, office, one floor": ItuIndoor("office", floors=1),
}
DISTANCES_M = np.geomspace(0.3, 300.0, 300)


def draw() -> None:
    """Write path-loss.svg."""
    figure, (axes,) = panels(1, 3.2)
    for index, (label, model) in enumerate(MODELS.items()):
        curve = model.curve(FREQUENCY_HZ)
        style = (0, (4, 3)) if isinstance(model, Friis) else "-"  # it covers others
        loss = [loss_db(curve, distance_m) for distance_m in DISTANCES_M]
        axes.plot(DISTANCES_M, loss, color=line_color(index), lw=1.5, ls=style, label=label)
        if isinstance(model, TwoRay):
            at_m = model.crossover_m(FREQUENCY_HZ)
            axes.plot(at_m, loss_db(curve, at_m), "o", ms=5, mfc="white", color=line_color(index))
            axes.annotate(
                f"crossover at {at_m:.1f} m",
                (at_m, loss_db(curve, at_m)),
                xytext=(5, 5),
                textcoords="offset points",
                fontsize=7,
                color=line_color(index),
            )
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.invert_yaxis()
    set_labels(axes, "path loss at 2.44 GHz; below 1 m it stays that of 1 m", "distance in m", "loss in dB")
    legend(axes, "lower left")
    write(figure, "path-loss")

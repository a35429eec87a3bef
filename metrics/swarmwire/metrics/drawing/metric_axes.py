"""How the values of a metric are plotted, wherever they are: the reach of the axis, its title, and whole numbers."""

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.registry import DELIVERY, METRICS


def is_count(name: str) -> bool:
    """Whether the metric adds up over the run; of one that is not registered nobody knows."""
    return name in METRICS and METRICS[name].kind == "count"


def limits(name: str, value: FloatArray) -> tuple[float, float]:
    """0 to 1 for shares, else from 0 or the least value to the greatest, with some air."""
    if name == DELIVERY or (name in METRICS and METRICS[name].bounds == (0.0, 1.0)):
        return -0.03, 1.05
    known = value[np.isfinite(value)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
    low = min(low, 0.0)
    span = max(high - low, 1.0 if is_count(name) else 1e-6)
    return low - 0.03 * span, high + 0.08 * span


def titled(name: str) -> str:
    """The name in words, with its unit if it has one."""
    unit = METRICS[name].unit if name in METRICS else ""
    words = name.replace("_", " ")
    return f"{words} ({unit})" if unit else words

"""How the values of a metric are plotted, wherever they are: the reach of the axis, its title, and whole numbers.

`facts` is what a run kept of its metrics, by name; of one that is not among them the registry is asked.
"""

from collections.abc import Mapping

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.record.metric_facts import MetricFacts, facts_of
from swarmwire.metrics.registry import METRICS

Facts = Mapping[str, MetricFacts]
UNKNOWN: Facts = {}


def told_of(name: str, facts: Facts) -> MetricFacts:
    """What is known of a metric: nothing but its name, at the least."""
    if name in facts:
        return facts[name]
    if name in METRICS:
        return facts_of(METRICS[name])
    return MetricFacts(name, "", "", "level", (None, None))


def is_count(name: str, facts: Facts = UNKNOWN) -> bool:
    """Whether the metric adds up over the run."""
    return told_of(name, facts).kind == "count"


def limits(name: str, value: FloatArray, facts: Facts = UNKNOWN) -> tuple[float, float]:
    """0 to 1 for shares, else from 0 or the least value to the greatest, with some air."""
    if told_of(name, facts).bounds == (0.0, 1.0):
        return -0.03, 1.05
    known = value[np.isfinite(value)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
    low = min(low, 0.0)
    span = max(high - low, 1.0 if is_count(name, facts) or low == high else 1e-6)
    return low - 0.03 * span, high + 0.08 * span


def titled(name: str, facts: Facts = UNKNOWN) -> str:
    """The name in words, with its unit if it has one."""
    unit = told_of(name, facts).unit
    words = name.replace("_", " ")
    return f"{words} ({unit})" if unit else words

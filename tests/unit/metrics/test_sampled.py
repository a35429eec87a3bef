"""A sampled metric is measured every so often, and holds its value in between."""

from dataclasses import dataclass

import numpy as np
import pytest

from swarmwire.metrics.metrics import Metrics
from swarmwire.metrics.sampled import Sampled
from tests.support.metrics.truths import static, truth


@dataclass(frozen=True)
class Ticks(Sampled):
    """The tick that was sampled."""

    name = "ticks_sampled"
    help = "the tick"
    bounds = (0.0, None)

    def sample(self, static):
        return lambda moment: np.full(static.arenas, float(moment.truth.tick))


def seen(every_s, ticks=12):
    of, metrics = static(2, arenas=2), Metrics([Ticks(every_s=every_s)])
    metrics.begin(of)
    found = []
    for tick in range(ticks):
        metrics.see(truth(of, tick))
        found.append(metrics.latest["ticks_sampled"].tolist())
    assert all(a == b for a, b in found)
    return [int(a) for a, _ in found]


def test_it_is_measured_at_the_start_and_at_each_multiple():
    assert seen(0.5) == [0] * 5 + [5] * 5 + [10] * 2
    assert seen(1.0) == [0] * 10 + [10] * 2


@pytest.mark.parametrize("every_s", [0.0, 0.05, 0.1])
def test_no_time_in_between_is_every_tick(every_s):
    assert seen(every_s) == list(range(12))


def test_what_is_no_multiple_of_a_tick_is_sampled_in_the_first_tick_after():
    assert seen(0.25) == [0, 0, 0, 3, 3, 5, 5, 5, 8, 8, 10, 10]


def test_one_metric_serves_many_runs():
    metrics, of = Metrics([Ticks()]), static(1)
    for tick in (3, 7):
        metrics.begin(of)
        metrics.see(truth(of, tick))
        assert metrics.latest["ticks_sampled"].tolist() == [tick]

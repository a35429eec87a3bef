"""Conditions that end arenas, read tick by tick as their definition says."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.clock import tick_start_ns, to_ns, to_s
from swarmwire.metrics.measure import Condition, Metrics, StopConditions
from swarmwire.metrics.metric import Metric
from tests.support.metrics.truths import static, truth

NONE = math.nan
COMPARED = {
    "at_least": lambda value, limit: value >= limit,
    "at_most": lambda value, limit: value <= limit,
    "above": lambda value, limit: value > limit,
    "below": lambda value, limit: value < limit,
}


@dataclass(frozen=True)
class Script(Metric):
    """What a test says, a row of arenas per tick."""

    values: tuple[tuple[float, ...], ...] = ()

    name = "script"
    help = "what a test says"
    bounds = (-1e9, None)

    def begin(self, static: Any) -> Any:
        return lambda moment: np.array(self.values[moment.truth.tick])


@dataclass(frozen=True)
class Tallied(Script):
    """The same, as a count."""

    name = "tallied"
    kind = "count"


def judged(values, *conditions, kind=Script):
    """The judge after these values (ticks, arenas) at 10 Hz, and in which tick each arena was found over (None)."""
    of = static(1, arenas=len(values[0]))
    metrics = Metrics([kind(values=tuple(map(tuple, values)))])
    stop_conditions = StopConditions(metrics, conditions)
    metrics.begin(of)
    stop_conditions.begin(of)
    found = [None] * of.arenas
    for tick in range(len(values)):
        for observer in (metrics, stop_conditions):
            observer.see(truth(of, tick))
        over = stop_conditions.done()
        for arena in range(of.arenas):
            if over is not None and over[arena] and found[arena] is None:
                found[arena] = tick
    return stop_conditions.end(None)["stops"], found


def one(series, *conditions, **options):
    stops, found = judged([[value] for value in series], *conditions, **options)
    return stops[0]["stop_time_s"], stops[0]["stopped_by"], found[0]


def script(comparison="at_least", limit=1.0, hold_s=0.0):
    return Condition("script", comparison, limit, hold_s)


@pytest.mark.parametrize(
    ("series", "condition", "stop"),
    [
        ([0, 0.5, 1, 0, 1], script(), (0.2, 2)),
        ([1, 0, 0, 1], script(), (0.0, 0)),
        ([1, 0, 1, 1, 1, 1], script(hold_s=0.3), (0.2, 5)),
        ([0, 1, 1, 1], script(hold_s=0.3), None),
        ([1, 1, NONE, 1, 1, 1], script(hold_s=0.2), (pytest.approx(0.3), 5)),
        ([NONE] * 3, script("below", 5.0), None),
        ([1.0], script("at_most"), (0.0, 0)),
        ([1.0], script("above"), None),
        ([1.0], script("below"), None),
    ],
)
def test_the_stop_time_is_where_the_first_stretch_that_held_began(series, condition, stop):
    stop_time_s, over = stop or (None, None)
    assert one(series, condition) == (stop_time_s, str(condition) if stop else None, over)


def test_a_condition_is_told_in_words():
    assert str(script()) == "script at least 1"
    assert str(script("above", 0.0, 0.2)) == "script above 0 for 0.2 s"


def test_of_several_conditions_any_is_enough_and_the_first_is_named():
    first, second = script("at_least", 2.0), script("above", 0.0, 0.2)
    assert one([0, 2, 2], first, second)[:2] == (0.1, str(first))
    assert one([1, 1, 2], first, second)[:2] == (0.2, str(first))
    assert one([1, 1, 1], first, second)[:2] == (0.0, str(second))


def test_a_count_is_compared_by_its_total():
    assert one([1, 2, 0, 3], Condition("tallied", "at_least", 6.0), kind=Tallied)[2] == 3


@given(
    values=st.lists(st.lists(st.sampled_from([0.0, 0.5, 1.0, NONE]), min_size=3, max_size=3), min_size=1, max_size=25),
    conditions=st.lists(
        st.builds(
            Condition,
            st.just("script"),
            st.sampled_from(list(COMPARED)),
            st.sampled_from([0.0, 0.5, 1.0]),
            st.sampled_from([0.0, 0.05, 0.1, 0.3, 0.7]),
        ),
        min_size=1,
        max_size=3,
    ),
)
def test_each_arena_ends_as_the_definition_reads(values, conditions):
    stops, found = judged(values, *conditions)
    for arena, series in enumerate(zip(*values, strict=True)):
        stop = by_definition(series, conditions)
        assert stops[arena] == {"stop_time_s": stop[1], "stopped_by": stop[2]}
        assert found[arena] == stop[0]


def by_definition(series, conditions):
    """The tick in which it is over, the start of the held stretch, and the condition, each looked for from scratch."""
    for now in range(len(series)):
        for of in conditions:
            true = [COMPARED[of.comparison](value, of.limit) for value in series]
            stretches = [start for start in range(now + 1) if all(true[start : now + 1])]
            long_enough = [t0 for t0 in stretches if time_ns(now) - time_ns(t0) >= to_ns(of.hold_s)]
            if long_enough:
                return now, to_s(time_ns(min(stretches))), str(of)
    return None, None, None


def time_ns(tick):
    return tick_start_ns(tick, 10)

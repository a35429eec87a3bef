"""Metrics as they are measured in a run, and the conditions on them that end arenas."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.clock import tick_start_ns, to_ns, to_s
from swarmwire.comms.base.config import parameter
from swarmwire.comms.base.errors import BadInput
from swarmwire.metrics.measures.measure import Condition, MeasuredStopConditions, Metrics
from swarmwire.metrics.measures.metric import Metric, Sampled
from swarmwire.metrics.measures.swarm.order import Order
from tests.support.metrics.truths import in_each_tick, poses, static, truth, watch


@dataclass(frozen=True)
class Turned(Metric):
    """Robots whose heading is above a threshold."""

    above_rad: float = parameter(0.0, help="threshold", unit="rad")

    name = "turned"
    help = "robots with a heading above a threshold"
    bounds = (0.0, None)

    def begin(self, static):
        return lambda view: np.count_nonzero(view.heading_rad > self.above_rad, axis=1).astype(np.float64)


def summaries(metrics, run, *ticks):
    watch(run, (truth(run, tick, **fields) for tick, fields in enumerate(ticks)), metrics)
    return metrics.end(None)["metrics"]


def test_level_has_final_mean_min_and_max_over_the_ticks():
    run = static(2)
    [summary] = summaries(Metrics(["order"]), run, *({"pose": poses([0.0, turn])} for turn in (0.0, np.pi, np.pi / 2)))
    half = np.sqrt(0.5)
    expected = {"final": half, "mean": (1 + half) / 3, "min": 0.0, "max": 1.0}
    assert summary["order"] == {name: pytest.approx(value, abs=1e-15) for name, value in expected.items()}


def test_count_ends_with_its_total_and_statistics_of_its_increments():
    run = static(2, arenas=2)
    onsets = ({"contact_onsets": np.array(pairs)} for pairs in ([[1, 0], [0, 2]], [[0, 0], [0, 2]], [[3, 0], [0, 0]]))
    first, second = summaries(Metrics(), run, *onsets)
    assert first["collisions"] == {"final": 4.0, "mean": pytest.approx(4 / 3), "min": 0.0, "max": 3.0}
    assert second["collisions"] == {"final": 0.0, "mean": 0.0, "min": 0.0, "max": 0.0}
    assert second["wall_contacts"] == {"final": 4.0, "mean": pytest.approx(4 / 3), "min": 0.0, "max": 2.0}


def test_ticks_without_a_value_are_left_out_and_what_never_had_one_is_null():
    run = static(2, radio=False)
    dead = {"alive": np.zeros(2, np.bool_)}
    [summary] = summaries(Metrics(), run, {"pose": poses([0.0, 0.0])}, dead)
    assert summary["order"] == {"final": None, "mean": 1.0, "min": 1.0, "max": 1.0}
    assert summary["largest_component"] == dict.fromkeys(("final", "mean", "min", "max"))


def test_metrics_of_a_run_without_a_tick_are_null():
    [summary] = summaries(Metrics(["order"]), static())
    assert summary["order"] == dict.fromkeys(("final", "mean", "min", "max"))


def test_metric_with_parameters_is_passed_as_an_object():
    run = static(3)
    [summary] = summaries(Metrics(["order", Turned(above_rad=1.0)]), run, {"pose": poses([0.0, 2.0, 3.0])})
    assert list(summary) == ["order", "turned"]
    assert summary["turned"]["final"] == 2.0


@pytest.mark.parametrize(
    ("names", "hint"), [(["ordre"], "'ordre'"), (["order", "order"], "'order'"), (["order", Order()], "'order'")]
)
def test_unknown_and_duplicate_metric_names_are_refused(names, hint):
    with pytest.raises(BadInput, check=lambda error: error.key == "metrics" and hint in error.expected):
        Metrics(names)


@dataclass(frozen=True)
class Ticks(Sampled):
    """The tick that was sampled."""

    name = "ticks_sampled"
    help = "the tick"
    bounds = (0.0, None)

    def sample(self, static):
        return lambda view: np.full(static.arenas, float(view.truth.tick))


def sampled_in(every_s, ticks=12):
    run = static(2, arenas=2)
    first, second = in_each_tick(run, (truth(run, tick) for tick in range(ticks)), Ticks(every_s=every_s))[:, 0].T
    assert first.tolist() == second.tolist()
    return first.tolist()


@pytest.mark.parametrize(
    ("every_s", "ticks"),
    [
        *((every_s, [*range(12)]) for every_s in (0.0, 0.05, 0.1)),
        (0.25, [0, 0, 0, 3, 3, 5, 5, 5, 8, 8, 10, 10]),  # the first tick after what is no multiple of a tick
        (0.5, [0] * 5 + [5] * 5 + [10] * 2),
        (1.0, [0] * 10 + [10] * 2),
    ],
)
def test_sampled_metric_is_measured_at_the_start_and_each_multiple(every_s, ticks):
    assert sampled_in(every_s) == ticks


def test_sampled_metric_serves_many_runs():
    metrics, run = Metrics([Ticks()]), static(1)
    for tick in (3, 7):
        metrics.begin(run)
        metrics.see(truth(run, tick))
        assert metrics.latest["ticks_sampled"].tolist() == [tick]


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
    run = static(1, arenas=len(values[0]))
    metrics = Metrics([kind(values=tuple(map(tuple, values)))])
    stop_conditions = MeasuredStopConditions(metrics, conditions)
    metrics.begin(run)
    stop_conditions.begin(run)
    over_at = [None] * run.arenas
    for tick in range(len(values)):
        for observer in (metrics, stop_conditions):
            observer.see(truth(run, tick))
        over = stop_conditions.done()
        for arena in range(run.arenas):
            if over is not None and over[arena] and over_at[arena] is None:
                over_at[arena] = tick
    return stop_conditions.end(None)["stops"], over_at


def one(series, *conditions, **options):
    stops, over_at = judged([[value] for value in series], *conditions, **options)
    return stops[0]["stop_time_s"], stops[0]["stopped_by"], over_at[0]


def script(comparison="at_least", limit=1.0, hold_s=0.0):
    return Condition("script", comparison, limit, hold_s)


def test_condition_is_written_in_words():
    assert str(script()) == "script at least 1"
    assert str(script("above", 0.0, 0.2)) == "script above 0 for 0.2 s"


def test_condition_that_keeps_the_arena_running_only_notes_its_time():
    aligned, slow = Condition("script", "at_least", 1.0, keep_running=True), script("at_least", 3.0)
    assert one([0, 1, 0, 1], aligned) == (0.1, str(aligned), None)
    assert one([0, 1, 0, 3, 0], aligned, slow) == (0.1, str(aligned), 3)


def test_condition_on_a_count_compares_its_total():
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
def test_stop_conditions_are_those_of_the_definition(values, conditions):
    stops, over_at = judged(values, *conditions)
    for arena, series in enumerate(zip(*values, strict=True)):
        stop = by_definition(series, conditions)
        assert stops[arena] == {"stop_time_s": stop[1], "stopped_by": stop[2]}
        assert over_at[arena] == stop[0]


def by_definition(series, conditions):
    """The tick in which it is over, the start of the held stretch, and the condition, each looked for from scratch."""
    for now in range(len(series)):
        for condition in conditions:
            true = [COMPARED[condition.comparison](value, condition.limit) for value in series]
            stretches = [start for start in range(now + 1) if all(true[start : now + 1])]
            long_enough = [t0 for t0 in stretches if time_ns(now) - time_ns(t0) >= to_ns(condition.hold_s)]
            if long_enough:
                return now, to_s(time_ns(min(stretches))), str(condition)
    return None, None, None


def time_ns(tick):
    return tick_start_ns(tick, 10)

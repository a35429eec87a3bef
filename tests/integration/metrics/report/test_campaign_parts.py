"""Parts of a campaign's report: numbers, values of a parameter as groups, and figures of whatever comes."""

import math

import numpy as np
import pytest

from swarmwire.metrics.report.axes import fits_log
from swarmwire.metrics.report.campaign_data import MAX_LEVELS, levels_of, rounding_of
from swarmwire.metrics.report.charts import Group, Jump, MedianLine, distributions, heat_map, response_curve
from swarmwire.metrics.report.charts_models import (
    FittedShape,
    SurvivalCurve,
    resilience_curve,
    scaling_curve,
    survival_curves,
)
from swarmwire.metrics.report.page import as_svg


@pytest.mark.parametrize(
    ("values", "spreads", "written"),
    [
        ([0.94123, 0.5], [0.051], ["0.941", "0.500"]),
        ([123.456, 7.0], [20.0], ["123", "7"]),
        ([3.0, 12345.0], [], ["3", "12,345"]),
        ([0.5, 12345.678], [], ["0", "12,346"]),
        ([1.5, 2.25], [], ["1.50", "2.25"]),
        ([-0.25, -0.0001], [0.1], ["−0.25", "0.00"]),
        ([1e-9, 3e-9], [], ["1.00e−09", "3.00e−09"]),
        ([2.5e8], [], ["2.50e+08"]),
        ([0.0, 0.0], [0.0], ["0", "0"]),
        ([math.nan, math.inf, 2.5], [math.nan], ["–", "–", "2.50"]),
        ([], [], []),
    ],
)
def test_decimals_follow_the_spread_or_else_the_size(values, spreads, written):
    rounding = rounding_of(values, spreads)
    assert [rounding.text(value) for value in values] == written


def test_numbers_are_in_ascending_order_and_names_as_they_were_asked_for():
    points = tuple({"x": x, "who": who} for x, who in ((0.5, "pso"), (0.1, "flocking"), (0.5, "flocking")))
    numbers, names = levels_of("x", points), levels_of("who", points)
    assert (numbers.labels, numbers.of_point.tolist()) == (("0.1", "0.5"), [1, 0, 1])
    assert (names.labels, names.of_point.tolist(), names.number) == (("pso", "flocking"), [0, 1, 1], None)
    assert numbers.points(1) == [0, 2]


def test_true_and_lists_are_names():
    points = tuple({"x": value} for value in (True, [1, 2.5], None, True))
    levels = levels_of("x", points)
    assert (levels.labels, levels.number) == (("true", "[1, 2.5]", "null"), None)


def test_as_many_values_as_can_be_shown_stay_apart():
    levels = levels_of("x", tuple({"x": x} for x in range(MAX_LEVELS)))
    assert (len(levels), levels.means) == (MAX_LEVELS, ())


@pytest.mark.parametrize("values", [[x / 100 for x in range(100)], [0.0] * 50 + [x * x for x in range(50)]])
def test_more_values_become_ranges_that_hold_every_point_once(values):
    levels = levels_of("x", tuple({"x": x} for x in values))
    assert levels.number is not None
    found = sorted(point for level in range(len(levels)) for point in levels.points(level))
    assert found == list(range(100))
    assert len(levels) <= 8
    for level, label in enumerate(levels.labels):
        part = [values[point] for point in levels.points(level)]
        low, high = map(float, label.split("–"))
        assert abs(low - min(part)) <= 1.0
        assert abs(high - max(part)) <= 1.0
        assert levels.number[level] == pytest.approx(sum(part) / len(part))
    assert (np.diff(levels.number) > 0.0).all()


pytest.importorskip("matplotlib", reason="needs the extra [report]")
NONE = (np.nan, np.nan, np.nan)
BEYOND = (np.inf, np.inf, np.inf)


def group(values, censored=0.0, quartiles=None):
    values = np.array(values, dtype=float)
    return Group("a", values, censored, quartiles or tuple(np.quantile(values, (0.25, 0.5, 0.75))))


@pytest.mark.parametrize(
    "groups",
    [
        [group([1.0])],
        [group([2.0] * 100), group([1.0, 3.0] * 30)],
        [group([], 0.0, NONE), group([1.0, 2.0])],
        [group([], 1.0, BEYOND), group([5.0], 0.9, BEYOND), group([5.0, 6.0], 0.5, (5.0, 6.0, np.inf))],
        [group(np.geomspace(0.01, 9.0, 200), 0.3)],
    ],
)
@pytest.mark.parametrize("limit", [None, 10.0])
def test_distributions_are_drawn_whether_values_differ_or_are_there_at_all(groups, limit):
    assert as_svg(distributions(groups, "what", "x", limit), "a")


@pytest.mark.parametrize(
    "values", [[0.5, 0.5, 0.5], [np.nan, 1.0, np.inf], [np.nan] * 3, [np.inf] * 3, [1.0, 100.0, 5000.0]]
)
@pytest.mark.parametrize("limit", [None, 9000.0])
@pytest.mark.parametrize("x", [[0.0, 1.0, 2.0], [0.01, 1.0, 200.0]])
def test_responses_are_drawn_with_and_without_a_limit_and_side_by_side(values, limit, x):
    values = np.array(values)
    line = MedianLine("a", np.array(x), values, values, values, values, values, Jump(0.5, 0.5, 1.5))
    assert as_svg(response_curve([line], "what", "x", limit), "a")
    assert as_svg(response_curve([line, line], "what", "x", limit), "a")


@pytest.mark.parametrize("value", [0.0, np.nan, np.inf, -3.0])
@pytest.mark.parametrize("columns", [1, 3, 12])
def test_maps_are_drawn_of_equal_of_no_and_of_censored_medians(value, columns):
    values = np.full((2, columns), value)
    labels = [str(place) for place in range(columns)]
    jumps = [None, Jump(0.5, 0.0, 1.0)]
    assert as_svg(heat_map(values, labels, ["a", "b"], "what", "x", "y", jumps), "a")


def test_survival_of_nobody_of_all_and_of_thousands():
    nobody = SurvivalCurve("a", np.empty(0), np.empty(0), np.empty(0), 0.0)
    waiting = SurvivalCurve("b", np.empty(0), np.empty(0), np.full(7, 30.0), 30.0)
    many = SurvivalCurve("c", np.arange(1.0, 5001.0), np.linspace(1.0, 0.0, 5000), np.arange(0.5, 5000.0), 5000.0)
    for curves in ([nobody], [waiting], [nobody, waiting, many], [many]):
        assert len(as_svg(survival_curves(curves, "what", "x"), "a")) < 60_000


def test_resilience_and_scaling_are_drawn_of_a_few_points():
    share = np.array([0.0, 0.5])
    shapes = [FittedShape("linear", share, 1.0 - share, better=True)]
    assert as_svg(resilience_curve(share, 1.0 - share, share, share, shapes, "what", "x"), "a")
    assert as_svg(scaling_curve(np.array([5.0, 50.0, 500.0]), np.array([np.nan, 1.0, 2.0]), "what", 1.0), "a")


@pytest.mark.parametrize(
    ("values", "logarithmic"),
    [
        ([1.0, 10.0, 1000.0], True),
        ([0.0, 10.0, 1000.0], False),
        ([1.0, 2.0], False),
        ([], False),
        ([np.nan, 5.0], False),
    ],
)
def test_an_axis_is_logarithmic_for_positive_values_over_decades(values, logarithmic):
    assert fits_log(np.array(values)) == logarithmic

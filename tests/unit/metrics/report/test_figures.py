"""Figures can be drawn of whatever comes: of one value, of equal ones, of none, and of nothing but censored ones."""

import numpy as np
import pytest

from swarmwire.metrics.report.figures.distributions import Group, distributions
from swarmwire.metrics.report.figures.heat_map import heat_map
from swarmwire.metrics.report.figures.log_axis import fits_log
from swarmwire.metrics.report.figures.resilience_curve import FittedShape, resilience_curve
from swarmwire.metrics.report.figures.response_curve import Jump, Response, response_curve
from swarmwire.metrics.report.figures.scaling_curve import scaling_curve
from swarmwire.metrics.report.figures.survival_curves import SurvivalCurve, survival_curves
from swarmwire.metrics.report.svg import as_svg

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
    response = Response("a", np.array(x), values, values, values, values, values, Jump(0.5, 0.5, 1.5))
    assert as_svg(response_curve([response], "what", "x", limit), "a")
    assert as_svg(response_curve([response, response], "what", "x", limit), "a")


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

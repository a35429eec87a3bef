"""Statistics as people read them."""

import math

import pytest

from swarmwire.metrics.statistics.interval import UNKNOWN, Interval
from swarmwire.metrics.statistics.summary import summary
from swarmwire.metrics.statistics.texts import interval_text, number_text, quartiles_text
from tests.support.metrics.statistics.samples import numbers, times, treated


@pytest.mark.parametrize(
    ("value", "text"),
    [(math.nan, "–"), (0.0, "0"), (-0.00012345, "-0.000123"), (999.4, "999"), (-123456.0, "-123456"), (2e9, "2e+09")],
)
def test_numbers_have_three_digits_or_all_before_the_point(value, text):
    assert number_text(value) == text


def test_quartiles_of_times_beyond_the_limit_say_so():
    assert quartiles_text(summary(treated())) == "23 (13 to > 35)"
    assert quartiles_text(summary(times([50.0, 50.0], [False, False]))) == "> 50 (> 50 to > 50)"
    assert quartiles_text(summary(numbers([]))) == "–"


@pytest.mark.parametrize("interval", [UNKNOWN, Interval(-math.inf, math.inf), Interval(math.nan, math.inf)])
def test_an_interval_that_tells_nothing_is_a_dash(interval):
    assert interval_text(interval) == "–"

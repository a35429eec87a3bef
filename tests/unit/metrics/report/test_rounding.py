"""Numbers are written as exactly as they deserve."""

import math

import pytest

from swarmwire.metrics.report.campaign.rounding import rounding_of


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

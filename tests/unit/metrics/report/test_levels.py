"""Values of a parameter, in order, as groups of design points."""

import numpy as np
import pytest

from swarmwire.metrics.report.campaign.levels import MOST_LEVELS, levels_of


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
    levels = levels_of("x", tuple({"x": x} for x in range(MOST_LEVELS)))
    assert (len(levels), levels.means) == (MOST_LEVELS, ())


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

"""Speeds of robots, averaged."""

import numpy as np
import pytest

from tests.support.metrics.truths import measured, static, truth


def speed(velocity, **given) -> float:
    of = static(len(velocity))
    return measured("speed", of, truth(of, velocity=np.array(velocity, float), **given))[0]


def test_the_mean_is_over_robots_whichever_way_they_go():
    assert speed([[0.3, 0.4, 0.0], [-0.1, 0.0, 0.0], [0.0, 0.0, 9.0]]) == pytest.approx(0.2)


def test_the_dead_do_not_count():
    assert speed([[0.3, 0.4, 0.0], [5.0, 0.0, 0.0]], alive=np.array([True, False])) == pytest.approx(0.5)
    assert np.isnan(speed([[0.3, 0.4, 0.0]], alive=np.array([False])))

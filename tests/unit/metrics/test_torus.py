"""On a torus metrics and pictures know shortest distances alone."""

from dataclasses import replace

import numpy as np
import pytest

from swarmwire.metrics.measures.torus import link_lines, shortest_displacement, unwrap_path
from swarmwire.metrics.pictures.drawing.swarm import in_range
from swarmwire.metrics.records.run_folder.distances import RobotPositions
from tests.support.comms.lines import indexed, is_blocked_on_floor
from tests.support.metrics.films import OBSTACLES
from tests.support.metrics.truths import static

SIZE_M = (8.0, 6.0)
TORUS = replace(static(4), boundary="torus")


def apart(a, b):
    away = np.abs(np.asarray(b) - a)
    return np.hypot(*np.minimum(away, SIZE_M - away).T)


def test_distances_between_senders_and_receivers_are_the_shortest():
    rng = np.random.default_rng(2)
    at = rng.uniform(-0.5, 0.5, (2, 50, 2)) * SIZE_M
    expected = apart(at[0], at[1])
    x, y = (np.concatenate([at[0, :, axis], at[1, :, axis]])[None] for axis in (0, 1))
    distance_m = RobotPositions(x, y, np.zeros((1, 100)), np.ones((1, 100), np.bool_), SIZE_M).apart_m(
        np.zeros(50, np.int64), *np.arange(100).reshape(2, 50)
    )
    assert distance_m == pytest.approx(expected)
    assert np.hypot(*shortest_displacement(at[0] - at[1], TORUS).T) == pytest.approx(expected)


def test_link_across_the_seam_is_drawn_shortest_from_both_ends():
    position = np.array([(3.9, 0.0), (-3.9, 0.2), (3.0, 0.0)])
    lines = link_lines(position, np.array([(0, 1), (0, 2)]), TORUS)
    assert np.allclose(lines, [[(3.9, 0.0), (4.1, 0.2)], [(3.9, 0.0), (3.0, 0.0)], [(-4.1, 0.0), (-3.9, 0.2)]])
    straight = link_lines(position, np.array([(0, 1)]), replace(TORUS, boundary="open"))
    assert np.array_equal(straight, [position[:2]])
    assert link_lines(position, np.empty((0, 2), np.int64), TORUS).shape == (0, 2, 2)


def test_path_across_the_seam_has_no_jumps_and_keeps_its_end():
    path = np.array([[(3.7, 2.9)], [(3.9, -3.0)], [(-3.9, -2.9)]], np.float32)
    assert np.allclose(unwrap_path(path, TORUS), [[(-4.3, -3.1)], [(-4.1, -3.0)], [(-3.9, -2.9)]], atol=1e-6)
    assert unwrap_path(path, replace(TORUS, boundary="walls")) is path


def test_pictures_join_robots_across_the_seam_as_the_air_does():
    at = np.random.default_rng(5).uniform(-0.5, 0.5, (70, 2)) * SIZE_M
    at[0] = -4.0, -3.0
    index = indexed((OBSTACLES,), SIZE_M)
    joined = {
        (i, j)
        for i in range(70)
        for j in range(i + 1, 70)
        if apart(at[i], at[j]) <= 2.0 and not is_blocked_on_floor(index, 0, *at[i], *at[j], *SIZE_M)
    }
    links = in_range(at, np.ones(70, np.bool_), 2.0, OBSTACLES, SIZE_M)
    assert {(min(pair), max(pair)) for pair in links.tolist()} == joined
    plain = in_range(at, np.ones(70, np.bool_), 2.0, OBSTACLES)
    assert len(plain) < len(joined)

"""Scaling: the laws of Amdahl and of robots that do not meet have their fractions."""

import numpy as np
import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.metrics.statistics.scaling import scaling

ROBOTS = np.array([1.0, 2.0, 5.0, 10.0])


def test_robots_that_do_not_hinder_one_another_are_wholly_efficient():
    work, times = scaling(ROBOTS, 3.0 * ROBOTS, is_time=False), scaling(ROBOTS, 60.0 / ROBOTS, is_time=True)
    for found in (work, times):
        np.testing.assert_allclose(found.speed_up, ROBOTS)
        np.testing.assert_allclose(found.efficiency, 1.0)
        np.testing.assert_allclose(found.serial_fraction, [np.nan, 0.0, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("serial", [0.05, 0.3, 1.0])
def test_amdahls_law_has_its_serial_fraction(serial):
    found = scaling(ROBOTS, serial + (1.0 - serial) / ROBOTS, is_time=True)
    np.testing.assert_allclose(found.serial_fraction[1:], serial)


def test_without_a_single_robot_the_smallest_swarm_is_the_reference():
    found = scaling(np.array([20.0, 5.0, 10.0]), np.array([40.0, 20.0, 30.0]), is_time=False)
    assert found.reference == 5.0
    np.testing.assert_allclose(found.speed_up, [2.0, 1.0, 1.5])
    np.testing.assert_allclose(found.efficiency, [0.5, 1.0, 0.75])
    np.testing.assert_allclose(found.serial_fraction, [1.0 / 3.0, np.nan, 1.0 / 3.0])


def test_times_that_are_not_known_have_no_efficiency_and_resamples_go_row_by_row():
    response = np.array([[60.0, 30.0, np.nan, 0.0], [60.0, 60.0, 60.0, 60.0]])
    found = scaling(ROBOTS, response, is_time=True)
    np.testing.assert_allclose(found.efficiency, [[1.0, 1.0, np.nan, np.nan], 1.0 / ROBOTS])


@pytest.mark.parametrize("robots", [[1.0], [1.0, 1.0], [0.0, 1.0], []])
def test_sizes_that_do_not_tell_are_refused(robots):
    with pytest.raises(BadInput):
        scaling(np.array(robots), np.ones(len(robots)), is_time=False)

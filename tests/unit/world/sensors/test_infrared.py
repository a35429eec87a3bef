"""Passive infrared sees robots and not walls, so that beside proximity it tells which is which."""

from typing import Any

import numpy as np
import pytest

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.sensors.rays import InfraredSpec, ProximitySpec, ResponseCurve
from swarmwire.comms.truth import Obstacle
from swarmwire.world.world import World
from tests.support.world.samples import posed
from tests.support.world.scenes import read, scene

EPUCK = load_body("epuck")
REACH_M = 10 * EPUCK.radius_m  # five diameters
RING: dict[str, Any] = {
    "angles_deg": tuple(range(-30, 330, 30)),  # four sectors of three: ahead, left, behind, right
    "range_m": REACH_M,
    "response": ResponseCurve(kind="quadratic", a=0.0, b=-1.0 / REACH_M, c=1.0, reach_m=REACH_M),
}


def seen(poses: Any, obstacles: tuple[Obstacle, ...] = (), **more: Any) -> tuple[FloatArray, FloatArray]:
    """What the first robot's proximity and passive infrared answer."""
    looked_at = scene(poses, EPUCK, obstacles, **more)
    active = read(looked_at, EPUCK, "proximity", ProximitySpec(**RING))["proximity.value"]
    passive = read(looked_at, EPUCK, "infrared", InfraredSpec(**RING))["infrared.value"]
    return active[0], passive[0]


@pytest.mark.parametrize(("bearing_deg", "sector"), [(0, 0), (90, 1), (180, 2), (270, 3), (44, 0), (-44, 0), (136, 2)])
def test_a_robot_shows_in_the_sector_where_it_stands(bearing_deg: float, sector: int) -> None:
    bearing = 0.4 + np.deg2rad(bearing_deg)
    other = [0.09 * np.cos(bearing), 0.09 * np.sin(bearing), 0.0]
    active, passive = seen([[0.0, 0.0, 0.4], other], boundary="open")
    assert np.array_equal(active, passive)
    assert int(passive.reshape(4, 3).sum(axis=1).argmax()) == sector


def test_a_wall_or_an_obstacle_shows_to_proximity_alone() -> None:
    pillar = Obstacle("cylinder", 4.8, 0.3, radius_m=0.1)
    active, passive = seen([[4.8, 0.0, 0.0], [0.0, 0.0, 0.0]], (pillar,))
    assert active[1] > 0.5 < active[4]  # ahead and to the left
    assert not passive.any()


def test_an_obstacle_hides_the_robot_behind_it_and_one_behind_the_robot_does_not() -> None:
    poses = [[0.0, 0.0, 0.0], [0.2, 0.0, 0.0]]
    plain = seen(poses, boundary="open")[1]
    assert plain[1] == pytest.approx(1.0 - (0.2 - 2 * EPUCK.radius_m) / REACH_M)
    behind = Obstacle("box", 0.3, 0.0, size_m=(0.05, 1.0))
    assert np.array_equal(seen(poses, (behind,), boundary="open")[1], plain)
    before = Obstacle("box", 0.1, 0.0, size_m=(0.05, 1.0))
    assert not seen(poses, (before,), boundary="open")[1].any()
    low = Obstacle("box", 0.1, 0.0, size_m=(0.05, 1.0), height_m=0.0)
    assert np.array_equal(seen(poses, (low,), boundary="open")[1], plain)


@pytest.mark.parametrize(("gap_m", "in_reach"), [(REACH_M - 1e-6, True), (REACH_M + 1e-6, False)])
def test_the_reach_is_counted_from_rim_to_rim(gap_m: float, in_reach: bool) -> None:
    passive = seen([[0.0, 0.0, 0.0], [2 * EPUCK.radius_m + gap_m, 0.0, 0.0]], boundary="open")[1]
    assert bool(passive.any()) is in_reach


def test_a_dead_robot_is_dark_and_hides_the_one_behind_it_and_proximity_sees_it_as_ever() -> None:
    poses = [[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.3, 0.0, 0.0]]
    active, passive = seen(poses, boundary="open")
    felt, dark = seen(poses, boundary="open", alive=[True, False, True])
    assert passive[1] == active[1] == felt[1] > 0.0
    assert not dark.any()
    assert np.array_equal(seen(poses, boundary="open", alive=[True, True, False])[1], passive)


def test_the_world_tells_its_sensors_who_is_alive() -> None:
    world = World(posed([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0]]), [1, 2], {})
    alive = world.scene.alive
    assert alive.all()
    world.live(np.array([True, False, True, True]))
    assert alive.tolist() == [[True, False], [True, True]]
    world.live(np.ones(4, np.bool_))
    assert alive.all()

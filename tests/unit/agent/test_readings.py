"""Both kinds of agent read the same of every sense; single robots get plain numbers."""

from dataclasses import astuple
from typing import ClassVar

import numpy as np
import pytest

from swarmwire.agent import Agent, VectorAgent
from swarmwire.agent.readings import Blob
from swarmwire.agent.testing import Trial, assert_equivalent, assert_rows_independent
from swarmwire.comms.errors import AgentFailed


class Moth(Agent):
    """Drives to the light, away from what it bumped into, and home."""

    needs: ClassVar[tuple[str, ...]] = ("light", "bumper", "positioning")

    def step(self, robot) -> None:
        x, y = robot.light.vector_sum()
        assert type(x) is type(robot.positioning.x_m) is float
        assert type(robot.bumper.pressed) is bool
        assert robot.light.value.shape == robot.light.angle_rad.shape == (8,)
        back = -0.05 if robot.bumper.pressed else 0.01 * x
        robot.drive(back, 0.1 * y + 0.01 * (robot.positioning.x_m - robot.positioning.y_m))


class VectorMoth(VectorAgent):
    """The same rule for n robots."""

    needs: ClassVar[tuple[str, ...]] = ("light", "bumper", "positioning")

    def step(self, robots, state) -> None:
        x, y = robots.light.vector_sum()
        assert robots.light.value.shape == (robots.n, 8)
        assert robots.light.angle_rad.shape == (8,)
        back = np.where(robots.bumper.pressed == 1.0, -0.05, 0.01 * x)
        robots.drive(back, 0.1 * y + 0.01 * (robots.positioning.x_m - robots.positioning.y_m))


class Watcher(Agent):
    """Drives to the nearest blob, slower on dark ground."""

    needs: ClassVar[tuple[str, ...]] = ("camera", "ground")

    def step(self, robot) -> None:
        blobs = robot.camera.blobs
        assert robot.ground.shade.shape == (4,)
        if blobs:
            assert isinstance(blobs[0], Blob)
            assert [type(value) for value in astuple(blobs[0])] == [float, float, int]
            robot.drive(0.1 * blobs[0].distance_m * robot.ground.shade[0], blobs[0].bearing_rad + 1e-9 * len(blobs))
            robot.led(*((blobs[-1].colour >> shift & 255) / 255 for shift in (16, 8, 0)))


class VectorWatcher(VectorAgent):
    """The same rule for n robots."""

    needs: ClassVar[tuple[str, ...]] = ("camera", "ground")

    def step(self, robots, state) -> None:
        camera, count = robots.camera, robots.camera.count
        last = np.where(count > 0, camera.colour[np.arange(robots.n), count - 1], 0.0).astype(np.int64)
        speed = 0.1 * camera.distance_m[:, 0] * robots.ground.shade[:, 0]
        robots.drive(speed, camera.bearing_rad[:, 0] + 1e-9 * count, rows=count > 0)
        robots.led(*((last >> shift & 255) / 255 for shift in (16, 8, 0)), rows=count > 0)


def test_blobs_and_shades_are_the_same_for_one_robot_and_many() -> None:
    assert_equivalent(Watcher, VectorWatcher, Trial(body="footbot"))
    assert_rows_independent(VectorWatcher, Trial(body="footbot"))


class Follower(Agent):
    """Turns from walls, which are what proximity sees and passive infrared does not."""

    needs: ClassVar[tuple[str, ...]] = ("proximity", "infrared")

    def step(self, robot) -> None:
        wall = robot.proximity.value * (robot.infrared.value == 0.0)
        assert wall.shape == robot.infrared.angle_rad.shape == (12,)
        robot.drive(robot.infrared.distance_m[1], float(wall.max()))


class VectorFollower(VectorAgent):
    """The same rule for n robots."""

    needs: ClassVar[tuple[str, ...]] = ("proximity", "infrared")

    def step(self, robots, state) -> None:
        wall = robots.proximity.value * (robots.infrared.value == 0.0)
        robots.drive(robots.infrared.distance_m[:, 1], wall.max(axis=1))


def test_passive_infrared_is_the_same_for_one_robot_and_many() -> None:
    assert_equivalent(Follower, VectorFollower, Trial(body="flockbot"))


class Roamer(Agent):
    """Turns away from the nearest return of the laser."""

    needs: ClassVar[tuple[str, ...]] = ("scan",)

    def step(self, robot) -> None:
        nearest = int(robot.scan.range_m.argmin())
        robot.drive(0.1, -float(robot.scan.angle_rad[nearest]))


class VectorRoamer(VectorAgent):
    """The same rule for n robots."""

    needs: ClassVar[tuple[str, ...]] = ("scan",)

    def step(self, robots, state) -> None:
        assert robots.scan.range_m.shape == (robots.n, 360)
        robots.drive(0.1, -robots.scan.angle_rad[robots.scan.range_m.argmin(axis=1)])


def test_a_scan_is_the_same_for_one_robot_and_many() -> None:
    assert_equivalent(Roamer, VectorRoamer, Trial(body="turtlebot3-burger"))


def test_one_robot_and_many_read_the_same() -> None:
    assert_equivalent(Moth, VectorMoth, Trial(body="epuck-gps"))
    assert_rows_independent(VectorMoth, Trial(body="epuck-gps"))


@pytest.mark.parametrize("sense", ["light", "bumper", "positioning"])
def test_a_sense_that_is_not_declared_is_refused(sense: str) -> None:
    class Peeks(VectorAgent):
        def step(self, robots, state) -> None:
            getattr(robots, sense)

    with pytest.raises(AgentFailed, match="NotDeclared"):
        assert_rows_independent(Peeks, Trial(body="epuck-gps"))

"""Pictures of the emulated e-puck2's camera."""

from math import pi, tan

import numpy as np
import pytest

from swarmwire.comms.base.geometry.floor import Floor, Patch
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.observe.truth import Light
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.world.gateways.epuck2.camera import picture, rgb565
from swarmwire.world.sensors.sensor import Scene
from tests.support.world.scenes import scene

BODY = load_body("epuck2")
FOCAL_PX = 80 / tan(0.42)
EYE_M, HIGH_M = 0.03, 0.028  # ahead of the robot's centre, and above the floor
ORIGIN = [0.0, 0.0, 0.0]


def pixels(looked_at: Scene, robot: int = 0) -> np.ndarray:
    """Red, green and blue, 0 to 255, (120, 160, 3), as a client decodes them."""
    encoded = np.frombuffer(picture(looked_at, robot), ">u2").reshape(120, 160).astype(int)
    return np.stack([(encoded >> 11 & 31) << 3, (encoded >> 5 & 63) << 2, (encoded & 31) << 3], axis=-1)


def grey_mask(rgb: np.ndarray) -> np.ndarray:
    """Pixels of walls, floor and sky, but for the rounding of the format."""
    return rgb.max(axis=-1) - rgb.min(axis=-1) <= 32


def bounds(mask: np.ndarray) -> tuple[int, int, int, int]:
    """First and last row, first and last column of a mask."""
    rows, columns = np.nonzero(mask)
    return int(rows.min()), int(rows.max()), int(columns.min()), int(columns.max())


def test_rgb565_has_the_high_byte_first() -> None:
    one_row = np.array([[[255, 0, 0], [0, 255, 0], [0, 0, 255], [8, 4, 8]]], np.uint8)
    assert rgb565(one_row) == bytes.fromhex("f800 07e0 001f 0821")


@pytest.mark.parametrize("distance_m", [0.15, 0.4, 1.0])
def test_body_in_the_picture_has_the_size_of_a_pinhole_camera(distance_m: float) -> None:
    looked_at = scene([ORIGIN, [distance_m + EYE_M, 0.0, pi]], BODY)
    looked_at.leds[0, 1, 9] = 0x00FF00
    top, bottom, left, right = bounds(~grey_mask(pixels(looked_at)))
    half = BODY.radius_m / np.sqrt(distance_m**2 - BODY.radius_m**2) * FOCAL_PX
    near_m = distance_m - BODY.radius_m
    assert (left, right) == pytest.approx((79.5 - half, 79.5 + half), abs=1.0)
    assert bottom == pytest.approx(59.5 + FOCAL_PX * HIGH_M / near_m, abs=1.0)
    assert top == pytest.approx(59.5 - FOCAL_PX * (BODY.height_m - HIGH_M) / near_m, abs=1.0)


def test_picture_shows_the_left_at_the_left_for_every_heading() -> None:
    for heading_rad in (0.0, 1.0, pi, -2.0):
        c, s = np.cos(heading_rad), np.sin(heading_rad)
        other = [0.4 * c - 0.1 * s, 0.4 * s + 0.1 * c, 0.0]
        looked_at = scene([[0.0, 0.0, heading_rad], other], BODY)
        looked_at.leds[0, 1, 9] = 0x00FF00
        _, _, left, right = bounds(~grey_mask(pixels(looked_at)))
        assert (left + right) / 2 == pytest.approx(79.5 - FOCAL_PX * 0.1 / (0.4 - EYE_M), abs=2.0)


def test_picture_hides_robots_behind_obstacles_or_the_camera() -> None:
    box = Obstacle("box", 0.5, 0.0, size_m=(0.05, 0.4), height_m=0.2)
    looked_at = scene([ORIGIN, [0.8, 0.0, 0.0], [-0.2, 0.0, 0.0]], BODY, (box,))
    looked_at.leds[0, 1:] = 0x0000FF
    assert not (pixels(looked_at)[:, :, 2] > 200).all(axis=0).any()
    blue = (pixels(looked_at)[:, :, 2] > 128) & (pixels(looked_at)[:, :, 0] < 64)
    assert not blue.any()
    in_front = scene([ORIGIN, [0.3, 0.0, 0.0]], BODY, (box,))
    in_front.leds[0, 1] = 0x0000FF
    mask = pixels(in_front)
    assert ((mask[:, :, 2] > 128) & (mask[:, :, 0] < 64)).any()


def test_picture_shows_only_leds_on_the_near_side() -> None:
    looked_at = scene([ORIGIN, [0.3, 0.0, pi]], BODY)  # facing the camera
    looked_at.leds[0, 1, 4] = 0xFF0000  # LED5, at its back
    red = pixels(looked_at)[:, :, 0] - pixels(looked_at)[:, :, 1] > 128
    assert not red.any()
    looked_at.leds[0, 1, 0] = 0xFF0000
    top, bottom, left, right = bounds(pixels(looked_at)[:, :, 0] - pixels(looked_at)[:, :, 1] > 128)
    near_m = 0.3 - BODY.radius_m - EYE_M
    assert (left + right) / 2 == pytest.approx(79.5, abs=1.0)
    assert (top + bottom) / 2 == pytest.approx(59.5 - FOCAL_PX * (0.04 - HIGH_M) / near_m, abs=1.0)


def test_walls_in_the_picture_meet_the_floor_at_their_distance() -> None:
    walled = pixels(scene([ORIGIN], BODY, size_m=2.0))
    floor_row = 59.5 + FOCAL_PX * HIGH_M / (1.0 - EYE_M)
    brightness = walled[:, 80, 1]
    assert np.flatnonzero(np.diff(brightness))[0] == pytest.approx(floor_row, abs=1.0)
    opened = pixels(scene([ORIGIN], BODY, size_m=2.0, boundary="open"))
    assert np.flatnonzero(np.diff(opened[:, 80, 1]))[0] == pytest.approx(59.5, abs=1.0)


def test_floor_patch_in_the_picture_is_dark_at_its_position() -> None:
    floor = Floor(1.0, (Patch("disc", 0.3, 0.0, 0.0, radius_m=0.05),))
    dark = pixels(scene([ORIGIN], BODY, floor=floor)).max(axis=-1) < 8
    top, bottom, left, right = bounds(dark)
    assert top == pytest.approx(59.5 + FOCAL_PX * HIGH_M / (0.35 - EYE_M), abs=1.0)
    assert bottom == pytest.approx(59.5 + FOCAL_PX * HIGH_M / (0.25 - EYE_M), abs=1.0)
    assert left + right == pytest.approx(159, abs=1.0)


def test_low_obstacle_in_the_picture_shows_its_top() -> None:
    low = Obstacle("cylinder", 0.3, 0.0, radius_m=0.05, height_m=0.01)
    top, bottom, _, _ = bounds(~grey_mask(pixels(scene([ORIGIN], BODY, (low,), size_m=2.0))))
    assert bottom == pytest.approx(59.5 + FOCAL_PX * HIGH_M / (0.25 - EYE_M), abs=1.0)
    assert top == pytest.approx(59.5 + FOCAL_PX * (HIGH_M - 0.01) / (0.35 - EYE_M), abs=1.0)


def test_lamp_is_the_brightest_in_the_picture() -> None:
    mask = pixels(scene([ORIGIN], BODY, lights=(Light(0.5, 0.1, 2.0),)))
    _, _, left, right = bounds(mask[:, :, 0] >= 248)
    assert (left + right) / 2 == pytest.approx(79.5 - FOCAL_PX * 0.1 / (0.5 - EYE_M), abs=2.0)


def test_picture_on_a_torus_shows_robots_across_the_edge() -> None:
    looked_at = scene([[0.9, 0.0, 0.0], [-0.9, 0.0, 0.0]], BODY, size_m=2.0, boundary="torus")
    looked_at.leds[0, 1, 9] = 0x00FF00
    assert not grey_mask(pixels(looked_at)[59, 80])


@pytest.mark.parametrize("side", [1, -1])
def test_picture_shows_objects_partly_in_view(side: int) -> None:
    edge_m = 0.5 * tan(0.42)  # distance from the axis 0.5 m ahead of the camera
    for aside_m, mask in ((edge_m + 0.045, True), (edge_m + 0.06, False)):
        column = Obstacle("cylinder", 0.5 + EYE_M, side * aside_m, radius_m=0.05)
        differs = (pixels(scene([ORIGIN], BODY, (column,))) != pixels(scene([ORIGIN], BODY))).any(axis=-1)
        assert differs.any() == mask
        assert not mask or bounds(differs)[2 if side > 0 else 3] == (0 if side > 0 else 159)

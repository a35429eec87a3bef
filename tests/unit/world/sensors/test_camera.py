"""A camera sees lit LEDs of other robots within its cone, unless a body hides them."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.bodies.drives import Leds
from swarmwire.comms.draws import normal, purpose
from swarmwire.comms.sensors.camera import CameraSpec
from swarmwire.comms.truth import Obstacle
from tests.support.world.scenes import read, scene

EPUCK, FOOTBOT = load_body("epuck"), load_body("footbot")
BEACON = replace(FOOTBOT, leds=Leds(angles_deg=(0.0,), height_m=0.085, radius_m=0.09, beacon_height_m=0.174249733))
HIGH = CameraSpec(height_m=0.2887, aperture_deg=70.0)
GREEN = 0x00FF00


def told(poses: Any, spec: CameraSpec = HIGH, tick: int = 0, **more: Any) -> dict[str, FloatArray]:
    body, colour = more.pop("body", BEACON), more.pop("colour", GREEN)
    looked_at = scene(poses, body, more.pop("obstacles", ()), boundary="open", colour=colour)
    if "dark" in more:
        looked_at.leds[0, :, more["dark"]] = 0
    fields = read(looked_at, body, "camera", spec, tick)
    return {name.removeprefix("camera."): values for name, values in fields.items()}


def distances(*at: Any, **more: Any) -> list[float]:
    """What the first robot, which looks along x, sees of others."""
    found = told([[0.0, 0.0, 0.0], *at], **more)["distance_m"][0]
    return found[np.isfinite(found)].tolist()


@pytest.mark.parametrize(
    ("height_m", "aperture_deg", "reach_m"),
    [(0.2887, 70.0, 0.793), (0.2887, 80.0, 1.64), (0.122, 70.0, 0.335)],
)
def test_a_camera_sees_as_far_as_argos_s_do(height_m: float, aperture_deg: float, reach_m: float) -> None:
    spec = CameraSpec(height_m=height_m, aperture_deg=aperture_deg)
    assert spec.reach_m(0.0) == pytest.approx(reach_m, abs=4e-3)
    low = replace(FOOTBOT, height_m=0.05, leds=Leds(angles_deg=(0.0,), radius_m=1e-9, height_m=0.05))
    for share, seen in ((0.999, 1), (1.001, 0)):
        assert len(distances([spec.reach_m(0.0) * share, 0.0, 0.0], spec=spec, body=low)) == seen


def test_a_blob_is_where_its_led_is() -> None:
    fields = told([[0.0, 0.0, 0.5], [0.3, 0.4, 0.9 + np.pi]], dark=1)  # only the one in front, nearest to the camera
    led = 0.3 + 0.09 * np.cos(0.9 + np.pi), 0.4 + 0.09 * np.sin(0.9 + np.pi)
    assert fields["distance_m"][0, :2] == pytest.approx([np.hypot(*led), np.nan], nan_ok=True)
    assert fields["bearing_rad"][0, 0] == pytest.approx(np.arctan2(led[1], led[0]) - 0.5)
    assert fields["colour"][0, 0] == GREEN
    assert {name: values.shape for name, values in fields.items()} == dict.fromkeys(fields, (2, 32))


def test_neither_own_leds_nor_dark_ones_are_seen() -> None:
    assert distances() == []
    assert distances([0.4, 0.0, 0.0], colour=0) == []


def test_a_robot_hides_its_own_far_side_and_what_is_low_behind_it_but_not_its_beacon() -> None:
    facing = [0.4, 0.0, np.pi]
    assert distances(facing) == pytest.approx([0.31, 0.4])
    assert distances([0.4, 0.0, 0.0]) == pytest.approx([0.4])
    between = [0.2, 0.0, np.pi]
    assert distances(between, facing, dark=1) == pytest.approx([0.11])
    assert distances(between, facing, dark=0) == pytest.approx([0.2, 0.4])


@pytest.mark.parametrize(("height_m", "seen"), [(0.05, 1), (0.1, 1), (0.25, 0)])
def test_an_obstacle_hides_what_the_line_to_passes_through_it(height_m: float, seen: int) -> None:
    """The line from 0.289 m to a beacon at 0.174 m is at 0.23 m halfway."""
    box = Obstacle("box", 0.2, 0.0, 0.3, size_m=(0.02, 0.3), height_m=height_m)
    assert len(distances([0.4, 0.0, 0.0], obstacles=(box,), dark=0)) == seen


def test_the_nearest_blobs_are_kept_in_order() -> None:
    apart_m = 0.75, 0.25, 0.5, 0.625, 0.375, 0.725
    others = [[d * np.cos(a), d * np.sin(a), 0.0] for a, d in enumerate(apart_m)]
    assert distances(*others, dark=0) == pytest.approx([0.25, 0.375, 0.5, 0.625, 0.725, 0.75])
    assert distances(*others, dark=0, spec=replace(HIGH, max_blobs=3)) == pytest.approx([0.25, 0.375, 0.5])


def test_the_error_of_a_distance_is_a_share_of_it() -> None:
    poses = [[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.0, 0.6, 0.0]]
    exact = told(poses, dark=0)
    noisy = told(poses, replace(HIGH, noise_relative=0.1), tick=3, dark=0)
    factor = 1.0 + 0.1 * normal(7, 0, 3, np.arange(2), purpose("camera.distance_m noise"))
    assert noisy["distance_m"][0, :2] == pytest.approx(exact["distance_m"][0, :2] * factor)
    assert np.array_equal(noisy["bearing_rad"], exact["bearing_rad"], equal_nan=True)


def test_a_lost_blob_is_lost_altogether() -> None:
    poses = np.random.default_rng(1).uniform(-1, 1, (30, 3)) * [0.8, 0.8, np.pi]
    exact, lossy = told(poses), told(poses, replace(HIGH, drop_out=0.3))
    lost = np.isfinite(exact["distance_m"]) & np.isnan(lossy["distance_m"])
    assert 0.2 < lost.sum() / np.isfinite(exact["distance_m"]).sum() < 0.4
    for name in ("bearing_rad", "colour"):
        assert np.array_equal(np.isnan(lossy[name]), np.isnan(lossy["distance_m"]))

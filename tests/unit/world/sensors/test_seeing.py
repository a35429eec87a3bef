"""Every sensor that looks around sees what a search among all things sees: in walls, in the open and on a torus."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.sensors.camera import CameraSpec
from swarmwire.comms.sensors.light import LightSpec
from swarmwire.comms.sensors.rays import InfraredSpec, ProximitySpec
from swarmwire.comms.sensors.scan import ScanSpec
from swarmwire.comms.truth import Boundary
from swarmwire.world.sensors.loading import sensor_of
from tests.support.world import brute_force
from tests.support.world.brute_force import FOOTBOT, Sample, sample

BOUNDARIES: list[Boundary] = ["walls", "open", "torus"]
ANGLES_DEG = (0.0, 17.0, 50.0, 90.0, 150.0, 210.0, 270.0, 310.0, 343.0)
assert FOOTBOT.proximity is not None
RESPONSE = replace(FOOTBOT.proximity.response, reach_m=0.6)


def truth(of: Sample, name: str, spec: Any) -> tuple[FloatArray, ...]:
    """The truth of all groups side by side, a row per robot of each arena."""
    fields = zip(*(sensor_of(name, spec, of.scene, group).truth(0) for group in of.groups), strict=True)
    return tuple(np.concatenate(field, axis=1).reshape(-1, field[0].shape[2]) for field in fields)


def same(seen: FloatArray, expected: FloatArray) -> None:
    """Equal but for rounding, and neither empty nor full."""
    assert np.array_equal(np.isfinite(seen), np.isfinite(expected))
    met = np.isfinite(expected)
    assert 0.1 < met.mean() < 0.95
    assert np.abs(seen[met] - expected[met]).max() < 1e-6  # near a tangent, the root of a rounding error


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_rays_from_the_rim_end_at_the_nearest_thing_or_for_passive_ones_the_nearest_robot(boundary: Boundary) -> None:
    of = sample(1, boundary)
    for name, kind in (("proximity", ProximitySpec), ("infrared", InfraredSpec)):
        spec = kind(angles_deg=ANGLES_DEG, range_m=0.6, response=RESPONSE)
        expected = brute_force.rim_rays(of, name == "proximity", spec.angle_rad, 0.6)
        answers = truth(of, name, spec)[0]
        assert answers == pytest.approx(RESPONSE.value(expected), abs=1e-6)
        assert 0.1 < np.isfinite(expected).mean() < 0.9


@pytest.mark.parametrize("boundary", BOUNDARIES)
@pytest.mark.parametrize(
    "turned",
    [
        {"rays": 17},
        {"rays": 20, "first_deg": -100.0, "span_deg": 200.0, "at_m": -0.03},
        {"rays": 7, "first_deg": 3000.0, "span_deg": 359.0},
        {"rays": 1, "first_deg": 45.0, "span_deg": 10.0},
    ],
)
def test_a_scan_shows_the_nearest_thing_on_every_ray(turned: dict[str, Any], boundary: Boundary) -> None:
    of, spec = sample(3, boundary), ScanSpec(range_m=1.0, **turned)
    same(truth(of, "scan", spec)[0], brute_force.scanned(of, spec.angle_rad, 1.0, spec.at_m))


@pytest.mark.parametrize("boundary", BOUNDARIES)
@pytest.mark.parametrize("seed", [4, 5])
def test_photocells_see_the_lights_that_nothing_beside_them_hides(seed: int, boundary: Boundary) -> None:
    of = sample(seed, boundary, each=5)
    spec = LightSpec(angles_deg=(0.0, 90.0, 180.0, 270.0))
    expected = brute_force.shone(of, spec.angle_rad)
    assert truth(of, "light", spec)[0] == pytest.approx(expected, abs=1e-9)
    assert 0.05 < (expected > 0).mean() < 0.6


@pytest.mark.parametrize("boundary", BOUNDARIES)
@pytest.mark.parametrize("height_m", [0.12, 0.25])
def test_a_camera_sees_the_leds_within_its_cone_that_no_body_hides(height_m: float, boundary: Boundary) -> None:
    of = sample(6, boundary, each=8)
    spec = CameraSpec(height_m=height_m, aperture_deg=70.0, max_blobs=200)
    seen, hidden = truth(of, "camera", spec), 0
    rows = [(arena, group, i) for arena in range(2) for group in of.groups for i in range(group.start, group.stop)]
    for row, (arena, group, robot) in enumerate(rows):
        expected = brute_force.blobs(of, arena, robot, spec.reach_m(group.body.altitude_m), height_m)
        count = len(expected)
        assert np.isfinite(seen[0][row]).tolist() == [True] * count + [False] * (200 - count)
        assert np.column_stack([field[row, :count] for field in seen]) == pytest.approx(
            np.array(expected).reshape(-1, 3)
        )
        hidden += count == 0
    assert 0 < hidden < len(rows) // 2

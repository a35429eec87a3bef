"""A laser scanner measures to walls and robots as its sheet says."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.body import body_from, load_body
from swarmwire.comms.draws import normal, purpose
from swarmwire.comms.errors import BadInput
from swarmwire.comms.sensors.scan import ScanSpec
from tests.support.world.scenes import read, scene

FOOTBOT = load_body("footbot")


def scanned(poses: Any, spec: ScanSpec, tick: int = 0, **more: Any) -> FloatArray:
    return read(scene(poses, FOOTBOT, **more), FOOTBOT, "scan", spec, tick)["scan.range_m"]


def test_the_walls_of_a_square_are_at_their_distances() -> None:
    spec = ScanSpec(rays=360, range_m=3.5)
    angle = 0.3 + spec.angle_rad
    to_walls = np.minimum(2.0 / np.abs(np.cos(angle)), 2.0 / np.abs(np.sin(angle)))
    assert scanned([[0.0, 0.0, 0.3]], spec, size_m=4.0)[0] == pytest.approx(to_walls, abs=1e-12)


def test_rays_stand_where_the_sheet_has_them() -> None:
    assert np.rad2deg(ScanSpec(rays=4, range_m=1.0).angle_rad) == pytest.approx([0.0, 90.0, 180.0, -90.0])
    half = ScanSpec(rays=5, range_m=1.0, first_deg=-90.0, span_deg=180.0)
    assert np.rad2deg(half.angle_rad) == pytest.approx([-90.0, -45.0, 0.0, 45.0, 90.0])


def test_ranges_are_counted_from_the_scanner() -> None:
    poses, spec = [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]], ScanSpec(rays=2, range_m=1.0)
    plain = scanned(poses, spec, boundary="open")
    assert plain == pytest.approx(np.array([[0.5 - FOOTBOT.radius_m, np.inf], [np.inf, 0.5 - FOOTBOT.radius_m]]))
    forward = scanned(poses, replace(spec, at_m=0.05), boundary="open")
    assert forward == pytest.approx(plain + np.array([[-0.05, 0.0], [0.0, 0.05]]))


def test_what_is_too_near_reads_the_least_range_and_nothing_reads_inf() -> None:
    poses = [[0.0, 0.0, 0.0], [0.2, 0.0, 0.0]]
    spec = ScanSpec(rays=2, range_m=1.0, range_min_m=0.12)
    assert scanned(poses, spec, boundary="open").tolist() == [[0.12, np.inf], [np.inf, 0.12]]


def test_noise_is_normal_keyed_and_grows_with_the_distance() -> None:
    spec = ScanSpec(rays=8, range_m=3.5, noise_m=0.01, noise_relative=0.02, range_min_m=0.1)
    exact = scanned([[0.2, 0.1, 0.3]], replace(spec, noise_m=0.0, noise_relative=0.0), size_m=4.0)[0]
    noisy = scanned([[0.2, 0.1, 0.3]], spec, tick=5, size_m=4.0)[0]
    error = (0.01 + 0.02 * exact) * normal(7, 0, 5, np.arange(8), purpose("scan.range_m noise"))
    assert noisy == pytest.approx(exact + error)
    assert np.all(scanned([[0.0, 0.0, 0.0]], spec, boundary="open") == np.inf)


def test_a_lost_ray_reads_as_if_nothing_were_there() -> None:
    told = scanned([[0.0, 0.0, 0.0]] * 1, ScanSpec(rays=360, range_m=3.5, drop_out=0.5), size_m=4.0)
    assert 0.4 < np.mean(np.isinf(told)) < 0.6


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"rays": 0}, "sensors.scan.rays: expected at least 1"),
        ({"rays": 2.5}, "sensors.scan.rays: expected a whole number"),
        ({"span_deg": 400.0}, "sensors.scan.span_deg: expected at most 360 deg"),
        ({"range_min_m": 3.5}, "sensors.scan.range_min_m: expected less than range_m"),
        ({"at_m": 0.1}, "sensors.scan.at_m: expected a place on the body"),
    ],
)
def test_a_scanner_that_cannot_be_is_refused(change: dict[str, Any], text: str) -> None:
    table = {"rays": 360, "range_m": 3.5, **change}
    with pytest.raises(BadInput, match=f"^mine.toml: {text}"):
        body_from({"like": "footbot", "sensors": {"scan": table}}, "mine.toml")

"""Ground sensors tell the shade of the floor under their points."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.body import body_from, load_body
from swarmwire.comms.draws import purpose, uniform
from swarmwire.comms.errors import BadInput
from swarmwire.comms.geometry.floor import Floor, Patch
from swarmwire.comms.sensors.simple import GroundSpec
from tests.support.world.scenes import read, scene

EPUCK = load_body("epuck")
THREE = GroundSpec(points_m=((0.03, -0.009), (0.03, 0.0), (0.03, 0.009)))  # ARGoS's e-puck
SPOT = Floor(0.8, (Patch("disc", 0.5, 0.2, 0.1, radius_m=0.1), Patch("disc", 0.5, 0.2, 0.4, radius_m=0.02)))


def shade(poses: Any, floor: Floor | None, spec: GroundSpec = THREE, tick: int = 0) -> FloatArray:
    return read(scene(poses, EPUCK, floor=floor), EPUCK, "ground", spec, tick)["ground.shade"]


def test_the_floor_is_white_where_there_is_none() -> None:
    assert shade([[0.0, 0.0, 0.0], [7.0, 0.0, 0.0]], None).tolist() == [[1.0] * 3] * 2


def test_each_point_tells_what_is_under_it() -> None:
    at_edge = [0.5 - 0.03, 0.2 + 0.1 - 0.009 / 2, 0.0]  # the left point is over the edge of the dark disc
    assert shade([[0.0, 0.0, 0.0], at_edge, [0.5 - 0.03, 0.2, 0.0]], SPOT).tolist() == [
        [0.8, 0.8, 0.8],
        [0.1, 0.1, 0.8],
        [0.4, 0.4, 0.4],
    ]


@given(turn=st.floats(-7, 7))
def test_points_turn_with_the_body(turn: float) -> None:
    ahead = [0.5 - 0.03 * np.cos(turn), 0.2 - 0.03 * np.sin(turn), turn]
    behind = [0.5 + 0.03 * np.cos(turn), 0.2 + 0.03 * np.sin(turn), turn]
    middle = shade([ahead, behind], SPOT)[:, 1]
    assert middle.tolist() == [0.4, 0.1]


def test_noise_is_uniform_keyed_and_clipped() -> None:
    noisy = shade([[0.0, 0.0, 0.0], [0.5, 0.2, 0.0]], SPOT, replace(THREE, noise=0.3), tick=4)
    draw = uniform(7, np.arange(2)[:, None], 4, np.arange(3), purpose("ground.shade noise"))
    exact = shade([[0.0, 0.0, 0.0], [0.5, 0.2, 0.0]], SPOT)
    assert noisy == pytest.approx(np.clip(exact + 0.3 * (2.0 * draw - 1.0), 0.0, 1.0))


@pytest.mark.parametrize(
    ("points", "text"),
    [
        ([[0.0, 0.0], [0.03, 0.03]], r"points_m\[1\]: expected a point under the body"),
        ([[0.0, 0.0, 0.0]], r"points_m\[0\]: expected 2 values"),
        ([], "points_m: expected at least one item"),
    ],
)
def test_points_that_are_not_under_the_body_are_refused(points: Any, text: str) -> None:
    with pytest.raises(BadInput, match=f"^mine.toml: sensors.ground.{text}"):
        body_from({"like": "epuck", "sensors": {"ground": {"points_m": points}}}, "mine.toml")

"""All behaviours: their parameters, what they need, and limits of their commands."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.agent import behaviours
from swarmwire.agent.behaviours import (
    Aggregation,
    Avoidance,
    BeaconAvoidance,
    Consensus,
    Coverage,
    Diffusion,
    Flocking,
    LennardJonesFlocking,
    MinimalistFlocking,
    PsoModel,
    PsoSearch,
    PsoSearchPositioned,
    RandomWalk,
    SmoothedAvoidance,
    SmoothedAvoidanceProximity,
    ThresholdRule,
    ThresholdRuleProximity,
    Vicsek,
)
from swarmwire.agent.behaviours.flocking import Heading
from swarmwire.agent.parameters import BadParameter, checked_parameters, parameters_of
from swarmwire.agent.testing import Trial, assert_rows_independent
from swarmwire.agent.vector_agent import VectorAgent
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.robot.bodies.body import load_body
from tests.support.agent.behaviours import OneRobot

FOOTBOT = load_body("footbot")
TURN_RADPS = 0.05 / 0.14  # one wheel at 5 cm/s on a base of 14 cm
ANGLES = np.deg2rad(7.5 + 15.0 * np.arange(24))
NOTHING = np.zeros(24)
STRAIGHT, LEFT, RIGHT = (0.05, 0.0), (0.025, TURN_RADPS), (0.025, -TURN_RADPS)
ALONG = {"alignment": 0.0}
neighbours_ = st.lists(
    st.tuples(st.floats(0.05, 2.0), st.floats(-3.1, 3.1), st.floats(-3.0, 3.0, width=32)), min_size=1, max_size=4
)
AHEAD, AWAY_RADPS = (0.05, 0.0), 1.5
ABOVE_ZERO: dict[type, tuple[str, ...]] = {
    Aggregation: ("spell_m", "approach_m", "turn_radps", "detection_threshold"),
    BeaconAvoidance: ("speed_mps", "clear_m", "horizon_s", "close_m"),
    Coverage: ("spell_m", "nearest_m", "turn_radps", "detection_threshold"),
    Flocking: ("separation_m",),
    LennardJonesFlocking: ("speed_mps", "target_m", "exponent", "detection_threshold", "hard_rad"),
    PsoModel: ("update_every_ticks",),
    RandomWalk: ("spell_m", "turn_radps", "detection_threshold"),
    SmoothedAvoidance: ("reach_m",),
}
NOT_NEGATIVE: dict[type, tuple[str, ...]] = {
    Aggregation: ("leave_per_s", "return_per_s"),
    BeaconAvoidance: ("smooth_s",),
    MinimalistFlocking: ("avoid_diameters", "separation_diameters", "lateral_diameters", "rear_diameters"),
    SmoothedAvoidance: ("smooth_s",),
    SmoothedAvoidanceProximity: ("smooth_s",),  # a subclass keeps the checks
}


def rays_at_wall(gap_m: float, normal_rad: float) -> FloatArray:
    """Ideal readings of a foot-bot whose rim is `gap_m` from an endless wall in direction `normal_rad` of its frame."""
    radius = 0.085036758
    towards = np.cos(ANGLES - normal_rad)
    distance = np.where(towards > 0.0, (radius + gap_m) / np.maximum(towards, 1e-9) - radius, np.inf)
    value = np.where(distance < 0.009889556, 1.0, 0.0100527 / (distance + 0.000163144))
    return np.where(distance <= 0.1, value, 0.0)


def command(
    kind: type[VectorAgent],
    value: FloatArray,
    heading: float = 0.0,
    neighbours: list[tuple[float, float, float]] | None = None,
    **params: float,
) -> tuple[float, float]:
    """Forward speed and turn rate of one foot-bot; `neighbours` are range, bearing and heading."""
    others = neighbours or []
    messages = [Heading(heading_rad=float(other_rad)) for _, _, other_rad in others]
    at = [(range_m, bearing_rad) for range_m, bearing_rad, _ in others]
    readings = {"proximity.value": value, "compass.heading_rad": heading}
    return OneRobot(kind, "footbot", **params).command(readings, messages, at)


@pytest.mark.parametrize(
    ("gap_m", "length"),
    [
        (0.09, 0.0091), (0.08, 0.0184), (0.06, 0.0310), (0.05, 0.0366), (0.04, 0.0446), (0.03, 0.0572),
        (0.02, 0.0861), (0.015, 0.1074), (0.01, 0.1448), (0.005, 0.1755),
    ],
)  # fmt: skip
def test_diffusion_head_on_drives_straight_until_the_mean_vector_is_long(gap_m: float, length: float) -> None:
    value = rays_at_wall(gap_m, 0.0)
    x, y = (value * np.cos(ANGLES)).mean(), (value * np.sin(ANGLES)).mean()
    assert np.hypot(x, y) == pytest.approx(length, abs=6e-5)  # the vectors of the source, to their last digit
    linear, angular = command(Diffusion, value)
    # The angle is 0 but for the rays' last bits, so these choose the side; the source turns left at an exact 0.
    expected = (0.05, 0.0) if length < 0.1 else (0.025, pytest.approx(TURN_RADPS))
    assert (linear, abs(angular)) == expected


def test_diffusion_reaches_the_threshold_at_1_65_cm() -> None:
    assert command(Diffusion, NOTHING) == command(Diffusion, rays_at_wall(0.0167, 0.0)) == STRAIGHT
    assert command(Diffusion, rays_at_wall(0.0163, 0.0))[1] != 0.0


@pytest.mark.parametrize(
    ("off_deg", "gap_m", "angle_deg"),
    [(15, 0.08, -15.0), (15, 0.02, -15.0), (10, 0.08, -7.7), (10, 0.05, -12.9), (10, 0.02, -9.1)],
)
def test_diffusion_turns_away_from_a_wall_that_is_not_dead_ahead(
    off_deg: float, gap_m: float, angle_deg: float
) -> None:
    value = rays_at_wall(gap_m, np.deg2rad(-off_deg))
    x, y = (value * np.cos(ANGLES)).mean(), (value * np.sin(ANGLES)).mean()
    assert np.rad2deg(np.arctan2(y, x)) == pytest.approx(angle_deg, abs=0.06)
    assert command(Diffusion, value) == pytest.approx(LEFT)  # the wall is to the right
    assert command(Diffusion, value[::-1]) == pytest.approx(RIGHT)


@pytest.mark.parametrize("normal_deg", [30, 90, 150, 180, -30, -90, -150])
def test_diffusion_turns_on_one_wheel_from_objects_not_ahead(normal_deg: float) -> None:
    linear, angular = command(Diffusion, rays_at_wall(0.05, np.deg2rad(normal_deg)))
    assert linear == 0.025
    if abs(normal_deg) < 180:
        assert np.sign(angular) == -np.sign(normal_deg)


def turn_of(neighbours: list[tuple[float, float, float]], value: FloatArray = NOTHING, **params: float) -> float:
    return command(Flocking, value, 0.0, neighbours, **params)[1]


@pytest.mark.parametrize("bearing_rad", [0.3, 1.5, 3.0, -0.3, -1.5, -3.0])
def test_flocking_turns_to_a_far_neighbour_and_away_from_a_near_one(bearing_rad: float) -> None:
    side = np.sign(bearing_rad)
    assert np.sign(turn_of([(0.9, bearing_rad, 0.0)], **ALONG)) == side
    assert np.sign(turn_of([(0.1, bearing_rad, 0.0)], **ALONG)) == -side
    assert turn_of([(0.4, bearing_rad, 0.0)], **ALONG) == 0.0


@pytest.mark.parametrize("own_rad", [0.0, 2.0, 3.1, -3.1])
@pytest.mark.parametrize("off_rad", [0.2, 1.0, 2.5, -0.2, -1.0, -2.5])
def test_flocking_turns_to_the_neighbours_heading_at_any_compass_reading(own_rad: float, off_rad: float) -> None:
    heading = (own_rad + off_rad + np.pi) % (2.0 * np.pi) - np.pi
    linear, angular = command(Flocking, NOTHING, own_rad, [(0.4, 0.7, heading)])
    assert np.sign(angular) == np.sign(off_rad)
    same = command(Flocking, NOTHING, 0.0, [(0.4, 0.7, off_rad)])
    assert (linear, angular) == pytest.approx(same, abs=1e-6)  # headings travel as f4


def test_flocking_turn_does_not_grow_with_the_number_of_neighbours() -> None:
    neighbours = [(0.9, 0.8, 0.4)]
    assert turn_of(neighbours * 5) == pytest.approx(turn_of(neighbours))
    assert command(Flocking, NOTHING) == (0.1, 0.0)


@pytest.mark.parametrize("normal_deg", [10, 30, 80, -10, -30, -80])
def test_flocking_turns_away_from_a_wall(normal_deg: float) -> None:
    linear, angular = command(Flocking, rays_at_wall(0.02, np.deg2rad(normal_deg)))
    assert np.sign(angular) == -np.sign(normal_deg)
    assert 0.0 <= linear < 0.1


def test_flocking_stops_and_turns_in_front_of_a_wall_dead_ahead() -> None:
    linear, angular = command(Flocking, rays_at_wall(0.02, 0.0))
    assert linear == 0.0
    assert abs(angular) > 1.0


@given(neighbours_, st.floats(0.03, 0.1), st.floats(-1.2, 1.2))
def test_flocking_is_the_same_in_a_mirror(neighbours: list[tuple[float, float, float]], gap: float, off: float) -> None:
    value = rays_at_wall(gap, off)
    linear, angular = command(Flocking, value, 0.0, neighbours)
    mirrored = [(r, -bearing, -heading) for r, bearing, heading in neighbours]
    got = command(Flocking, value[::-1], 0.0, mirrored)
    assert got[0] == pytest.approx(linear, abs=1e-6)
    # Behind is both +pi and -pi: there a mirror image may turn either way.
    assert got[1] == pytest.approx(-angular, abs=1e-6) or abs(angular) > 2.0 * np.pi - 1e-3


def one_ray(angle_deg: float, distance_m: float) -> FloatArray:
    """The foot-bot's ray nearest to an angle sees something, the others nothing."""
    value = np.zeros(24)
    assert FOOTBOT.proximity is not None
    turned = (ANGLES - np.deg2rad(angle_deg) + np.pi) % (2.0 * np.pi) - np.pi
    value[np.argmin(np.abs(turned))] = FOOTBOT.proximity.response.value(np.array(distance_m))
    return value


@pytest.mark.parametrize(
    ("angle_deg", "distance_m", "turns"),
    [
        (37.5, 0.05, False),  # ahead, and far
        (37.5, 0.02, True),  # ahead, and near
        (52.5, 0.09, True),  # at the side, however far
        (142.5, 0.09, True),
        (142.5, 0.01, True),
        (157.5, 0.01, False),  # behind, however near
        (172.5, 0.01, False),
    ],
)
def test_avoidance_turns_from_near_objects_ahead_or_to_a_side(angle_deg: float, distance_m: float, turns: bool) -> None:
    for side in (1.0, -1.0):
        expected = (0.0, -side * AWAY_RADPS) if turns else AHEAD
        assert command(Avoidance, one_ray(side * angle_deg, distance_m)) == expected


def test_avoidance_goes_by_the_sum_of_all_rays() -> None:
    """Two things at 60 degrees to the left and to the right add up to one ahead, as far as the nearest of them."""
    both = one_ray(60.0, 0.05) + one_ray(-60.0, 0.06)
    assert command(Avoidance, both) == AHEAD
    assert command(Avoidance, both, safe_m=0.055) == (0.0, -AWAY_RADPS)


def test_avoidance_takes_faint_answers_for_noise() -> None:
    noise = 0.09 * one_ray(60.0, 0.005)
    assert command(Avoidance, noise) == command(Avoidance, NOTHING) == AHEAD
    assert command(Avoidance, noise, detection_threshold=0.05) == (0.0, -AWAY_RADPS)


def test_avoidance_turns_on_an_arc_with_turn_mps() -> None:
    assert command(Avoidance, one_ray(60.0, 0.05), turn_mps=0.02, turn_radps=0.5) == (0.02, -0.5)


@given(st.lists(st.sampled_from([0.0, 0.0, 0.3, 0.6, 1.0]), min_size=24, max_size=24), st.floats(0.0, 0.1))
def test_avoidance_is_the_same_in_a_mirror(value: list[float], safe_m: float) -> None:
    rays = np.array(value)
    x, y = np.sum(rays * np.cos(ANGLES)), np.sum(rays * np.sin(ANGLES))
    degrees = abs(np.rad2deg(np.arctan2(y, x)))
    # On a border of the rule the last bits decide.
    if abs(y) > 1e-9 and min(abs(degrees - 45.0), abs(degrees - 150.0)) > 1e-6:
        linear, angular = command(Avoidance, rays, safe_m=safe_m)
        assert command(Avoidance, rays[::-1], safe_m=safe_m) == (linear, -angular)


OFTEN = {"update_every_ticks": 3, "tell_before_ticks": 1}
RING = {"ring_count": 7, "ring_index": [0, 1, 2, 3, 4, 5, 6]}
INDEPENDENCE: list[tuple[type[VectorAgent[Any]], Trial]] = [
    *((kind, Trial(ticks=30)) for kind in (Aggregation, Coverage, RandomWalk)),
    *((Avoidance, Trial(seed=seed, body=body)) for seed in (1, 2) for body in ("epuck", "footbot")),
    (BeaconAvoidance, Trial(seed=1, ticks=25)),
    (BeaconAvoidance, Trial(seed=2, robots=14, ticks=25)),
    (Consensus, Trial(body="point", params={"start_width": 1.0})),
    *((kind, Trial()) for kind in (Diffusion, Flocking)),
    (LennardJonesFlocking, Trial(body="footbot")),
    (MinimalistFlocking, Trial(body="flockbot")),
    (MinimalistFlocking, Trial(body="flockbot", seed=2, params={"random_turn": 0.5})),
    *(
        (kind, Trial(body="epuck-gps", params={**OFTEN, **more}))
        for kind in (PsoModel, PsoSearch, PsoSearchPositioned)
        for more in ({}, RING, {"keeps_received": False, "again_m": 0.5})
    ),
    *((kind, Trial(body="turtlebot3-burger")) for kind in (SmoothedAvoidance, ThresholdRule)),
    *((kind, Trial(body="footbot")) for kind in (SmoothedAvoidanceProximity, ThresholdRuleProximity)),
    *((kind, Trial(body="epuck", seed=2)) for kind in (SmoothedAvoidanceProximity, ThresholdRuleProximity)),
    (Vicsek, Trial(body="point")),
]


@pytest.mark.parametrize(("kind", "trial"), INDEPENDENCE, ids=lambda value: getattr(value, "__name__", None))
def test_behaviour_rows_are_independent(kind: type[VectorAgent], trial: Trial) -> None:
    assert_rows_independent(kind, trial)


def test_behaviours_all_have_a_trial_of_independence() -> None:
    assert {kind.__name__ for kind, _ in INDEPENDENCE} == set(behaviours.__all__)


def pairs(names_by_kind: dict[type, tuple[str, ...]]) -> list[Any]:
    return [
        pytest.param(kind, name, id=f"{kind.__name__}.{name}")
        for kind, names in names_by_kind.items()
        for name in names
    ]


def refused(kind: type, params: dict[str, Any], text: str) -> str:
    with pytest.raises(BadParameter, match=text) as caught:
        checked_parameters(kind, params)
    return caught.value.key


@pytest.mark.parametrize(("kind", "name"), pairs(ABOVE_ZERO))
def test_parameters_that_divide_must_be_above_zero(kind: type, name: str) -> None:
    assert refused(kind, {name: 0}, "expected more than 0, got 0") == name
    assert refused(kind, {name: -1}, "expected more than 0, got -1") == name


@pytest.mark.parametrize(("kind", "name"), pairs(NOT_NEGATIVE))
def test_parameters_that_may_be_zero_accept_zero(kind: type, name: str) -> None:
    assert checked_parameters(kind, {name: 0})[name] == 0
    assert refused(kind, {name: -1}, "expected at least 0, got -1") == name


@pytest.mark.parametrize(("kind", "name"), [(RandomWalk, "persistence"), (MinimalistFlocking, "random_turn")])
def test_shares_are_within_0_and_1(kind: type, name: str) -> None:
    assert [checked_parameters(kind, {name: share})[name] for share in (0, 1)] == [0.0, 1.0]
    assert refused(kind, {name: -0.1}, "expected at least 0, got -0.1") == name
    assert refused(kind, {name: 1.1}, "expected at most 1, got 1.1") == name


@pytest.mark.parametrize(
    ("kind", "lower", "upper", "low", "high"),
    [
        (BeaconAvoidance, "relaxed", "alarm", 0.05, 0.2),
        (LennardJonesFlocking, "soft_rad", "hard_rad", 1.2217, 1.5708),
        (SmoothedAvoidance, "free_rad", "blocked_rad", 0.7854, 1.5708),
    ],
)
def test_hysteresis_order_is_checked_with_defaults(kind, lower, upper, low, high) -> None:
    assert refused(kind, {lower: 2 * high}, f"expected at most {upper}, {high}; got {2 * high}") == lower
    assert refused(kind, {upper: low / 2}, f"expected at most {upper}, {low / 2}; got {low}") == lower
    checked_parameters(kind, {lower: 2 * high, upper: 2 * high})


@pytest.mark.parametrize("kind", [getattr(behaviours, name) for name in behaviours.__all__])
def test_behaviours_accept_their_own_defaults(kind: type) -> None:
    checked_parameters(kind, {name: parameter.default for name, parameter in parameters_of(kind).items()})

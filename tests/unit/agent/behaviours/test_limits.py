"""Limits of the behaviours' parameters, and angles within half a turn."""

from typing import Any

import pytest

from swarmwire.agent import behaviours
from swarmwire.agent.behaviours import (
    Aggregation,
    BeaconAvoidance,
    Coverage,
    Flocking,
    LennardJonesFlocking,
    MinimalistFlocking,
    PsoModel,
    RandomWalk,
    SmoothedAvoidance,
    SmoothedAvoidanceProximity,
)
from swarmwire.agent.parameters import BadParameter, checked, parameters_of

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
}


def pairs(of: dict[type, tuple[str, ...]]) -> list[Any]:
    return [pytest.param(kind, name, id=f"{kind.__name__}.{name}") for kind, names in of.items() for name in names]


def refused(kind: type, params: dict[str, Any], text: str) -> str:
    with pytest.raises(BadParameter, match=text) as caught:
        checked(kind, params)
    return caught.value.key


@pytest.mark.parametrize(("kind", "name"), pairs(ABOVE_ZERO))
def test_what_is_divided_by_or_waited_for_is_above_zero(kind: type, name: str) -> None:
    assert refused(kind, {name: 0}, "expected more than 0, got 0") == name
    assert refused(kind, {name: -1}, "expected more than 0, got -1") == name


@pytest.mark.parametrize(("kind", "name"), pairs(NOT_NEGATIVE))
def test_zero_is_taken_where_only_less_makes_no_sense(kind: type, name: str) -> None:
    assert checked(kind, {name: 0})[name] == 0
    assert refused(kind, {name: -1}, "expected at least 0, got -1") == name


@pytest.mark.parametrize(("kind", "name"), [(RandomWalk, "persistence"), (MinimalistFlocking, "random_turn")])
def test_a_share_is_within_0_and_1(kind: type, name: str) -> None:
    assert [checked(kind, {name: share})[name] for share in (0, 1)] == [0.0, 1.0]
    assert refused(kind, {name: -0.1}, "expected 0 to 1, got -0.1") == name
    assert refused(kind, {name: 1.1}, "expected 0 to 1, got 1.1") == name


@pytest.mark.parametrize(
    ("kind", "lower", "upper", "low", "high"),
    [
        (BeaconAvoidance, "relaxed", "alarm", 0.05, 0.2),
        (LennardJonesFlocking, "soft_rad", "hard_rad", 1.2217, 1.5708),
        (SmoothedAvoidance, "free_rad", "blocked_rad", 0.7854, 1.5708),
    ],
)
def test_hysteresis_ends_no_later_than_it_begins_defaults_included(kind, lower, upper, low, high) -> None:
    assert refused(kind, {lower: 2 * high}, f"expected at most {upper}, {high}; got {2 * high}") == lower
    assert refused(kind, {upper: low / 2}, f"expected at most {upper}, {low / 2}; got {low}") == lower
    checked(kind, {lower: 2 * high, upper: 2 * high})


def test_a_subclass_keeps_the_limits_with_its_own_defaults() -> None:
    assert refused(SmoothedAvoidanceProximity, {"smooth_s": -0.1}, "at least 0") == "smooth_s"


@pytest.mark.parametrize("kind", [getattr(behaviours, name) for name in behaviours.__all__])
def test_every_behaviour_takes_its_own_defaults(kind: type) -> None:
    checked(kind, {name: parameter.default for name, parameter in parameters_of(kind).items()})

"""Validation of scenarios: checks that need more than one key.

`check` tests bodies, physics steps, obstacles, the radio's offset and events against one another.
"""

import math
from collections.abc import Mapping

import numpy as np

from swarmwire.comms.base.config import did_you_mean
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.protocols.ros2.keys import RADIO_TOPICS, check_name
from swarmwire.comms.protocols.ros2.relay import PART
from swarmwire.comms.radio.config.antennas import check_pattern
from swarmwire.comms.radio.config.checks import check_radio, check_spreading, unfit_for_torus
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.world.actuation.actuators import noise_of
from swarmwire.world.engines.physics import check_engines, engines_of
from swarmwire.world.events.event import Event
from swarmwire.world.events.robot_events import Impulse
from swarmwire.world.placement.maps import read_layout
from swarmwire.world.placement.occupancy import heading_of, obstacle_at
from swarmwire.world.scenario.arena import ObstacleTable
from swarmwire.world.scenario.bodies import bodies_of
from swarmwire.world.scenario.motion import TraceMotion
from swarmwire.world.scenario.scenario import Scenario

MAX_STEP_RADII = 0.25  # the greatest move of a robot at full speed in one physics step, in radii


def check(scenario: Scenario, where: str) -> None:
    """Raise BadInput for the first contradiction in a scenario."""
    bodies = bodies_of(scenario, where)
    check_engines(scenario, bodies, where)
    _check_steps(scenario, bodies, where)
    size_m = read_layout(scenario.arena, where).size_m
    for i, obstacle in enumerate(scenario.arena.obstacles):
        _check_obstacle(size_m, obstacle, f"arena.obstacles.{i}", where)
    _check_send_offset(scenario, where)
    if scenario.radio is not None:
        check_radio(scenario.radio, where)
        _check_torus(scenario, scenario.radio, where)
    _check_antennas(scenario, where)
    _check_station(scenario, where)
    _check_motion(scenario, where)
    _check_relay(scenario, where)
    for i, event in enumerate(scenario.events):
        check_event(scenario, bodies, event, f"events.{i}", where)


def _check_steps(scenario: Scenario, bodies: dict[str, Body], where: str) -> None:
    for group, engine in engines_of(scenario, bodies).items():
        body = bodies[group]
        tick_m = body.max_linear_mps * max(1.0, noise_of(body.drive).factor) / scenario.time.rate_hz
        needed = math.ceil(tick_m / (MAX_STEP_RADII * body.radius_m) - 1e-9)
        moves = engine != "kinematic" and not scenario.robots[group].motion
        if moves and scenario.physics.steps < needed:
            text = f"so that a robot of {group} at full speed moves at most a quarter of its radius in one step"
            raise BadInput(where, "physics.steps", f"expected at least {needed}, {text}; got {scenario.physics.steps}")


def _check_obstacle(extents_m: tuple[float, float], table: ObstacleTable, key: str, where: str) -> None:
    """Check that an obstacle with a position lies within the arena, or that a random obstacle fits into it."""
    size_m = np.array(extents_m)
    low, high = obstacle_at(table, *(table.at or (0.0, 0.0)), heading_of(table) or 0.0).extent_m
    fits = np.all(high - low <= size_m + 2e-9)
    if not fits or (table.at and (np.any(high > 0.5 * size_m + 1e-9) or np.any(low < -0.5 * size_m - 1e-9))):
        size = " x ".join(f"{side:g}" for side in size_m)
        raise BadInput(where, key, f"expected the {table.shape} to lie within the arena of {size} m")


def _check_send_offset(scenario: Scenario, where: str) -> None:
    offset, tick_s = scenario.radio.send_offset if scenario.radio else "uniform", 1.0 / scenario.time.rate_hz
    is_valid = offset in ("uniform", "tick") if isinstance(offset, str) else 0.0 <= offset < tick_s
    if not is_valid:
        expected = "expected uniform, tick, or an offset in s from 0 to below the period of a tick"
        raise BadInput(where, "radio.send_offset", f"{expected}; got {offset!r}")


def _check_torus(scenario: Scenario, radio: Radio, where: str) -> None:
    key = unfit_for_torus(radio) if scenario.arena.boundary == "torus" else None
    if key is not None:
        expected = "expected a disk without bodies_block: line of sight across a torus's seam is not defined"
        raise BadInput(where, f"radio.{key}", expected)


def _check_antennas(scenario: Scenario, where: str) -> None:
    for group, table in scenario.robots.items():
        if table.radio is not None and (scenario.radio is None or not scenario.radio.is_phy):
            reason = "a disk knows no strength" if scenario.radio else "there is no [radio]"
            raise BadInput(where, f"robots.{group}.radio", f"expected a radio with a PHY: {reason}")
        if table.radio is not None:
            check_pattern(table.radio.pattern, where, f"robots.{group}.radio.pattern")
        if scenario.radio is not None and table.radio is not None and table.radio.spreading_factor is not None:
            check_spreading(scenario.radio, table.radio.spreading_factor, where, f"robots.{group}.radio")


def _check_station(scenario: Scenario, where: str) -> None:
    name = scenario.radio.access_or_default.station if scenario.radio else None
    robots = (*scenario.robots, *scenario.robot_names())
    if name is not None and name not in robots:
        expected = f"expected a group or a robot of the scenario, {did_you_mean(robots, name)}; got {name!r}"
        raise BadInput(where, "radio.access.station", expected)


def _check_motion(scenario: Scenario, where: str) -> None:
    for group, table in scenario.robots.items():
        if table.motion is not None and scenario.arena.boundary == "torus":
            expected = "expected walls or open as arena.boundary: a source's poses do not wrap around a torus"
            raise BadInput(where, f"robots.{group}.motion", expected)
        if isinstance(table.motion, TraceMotion):
            is_geodetic = table.motion.file.lower().endswith(".eel")
            if is_geodetic != (table.motion.origin is not None):
                reason = "its positions are latitudes and longitudes" if is_geodetic else "only for .eel"
                got = "" if is_geodetic else "no "
                raise BadInput(where, f"robots.{group}.motion.origin", f"expected {got}origin for this file: {reason}")


def _check_relay(scenario: Scenario, where: str) -> None:
    topics, radio = scenario.ros2.relay.topics, scenario.radio
    if topics and (radio is None or radio.max_payload_bytes <= PART.size):
        got = f"got packets of at most {radio.max_payload_bytes}" if radio else "there is no [radio]"
        raise BadInput(where, "ros2.relay", f"expected a radio with packets of more than {PART.size} bytes: {got}")
    names = [topic.name for topic in topics]
    robots = (*scenario.robots, *scenario.robot_names())
    for i, topic in enumerate(topics):
        key = f"ros2.relay.topics.{i}"
        check_name(topic.name, where, f"{key}.name")
        if topic.name.startswith(("/", RADIO_TOPICS)) or topic.name in names[:i]:
            expected = f"expected names that differ, in the robots' namespaces, outside {RADIO_TOPICS}"
            raise BadInput(where, f"{key}.name", f"{expected}; got {topic.name!r}")
        for name in topic.to:
            if name not in robots:
                expected = f"expected groups or robots of the scenario, {did_you_mean(robots, name)}; got {name!r}"
                raise BadInput(where, f"{key}.to", expected)


def _check_impulse(scenario: Scenario, bodies: Mapping[str, Body], event: Impulse) -> None:
    """Check that the robots' engine has forces, and that the impulse moves no robot through an obstacle in one step."""
    engines = engines_of(scenario, bodies)
    for group in event.robots.groups(scenario.groups()):
        if engines[group] == "kinematic" or scenario.robots[group].motion:
            reason = "follow a source" if scenario.robots[group].motion else "are kinematic"
            raise BadInput("", "robots", f"expected robots whose bodies have contacts: those of {group} {reason}")
        max_mps = bodies[group].radius_m * scenario.time.rate_hz * scenario.physics.steps
        if event.speed_mps > max_mps:
            bound = (
                f"with which a robot of {group} moves by its radius in one of {scenario.physics.steps} physics.steps"
            )
            raise BadInput("", "speed_mps", f"expected at most {max_mps:g} m/s, {bound}; got {event.speed_mps!r}")


def check_event(scenario: Scenario, bodies: Mapping[str, Body], event: Event, key: str, where: str) -> None:
    """Raise BadInput unless the robots of an event exist and the radio and the engines support it."""
    if event.needs_radio and scenario.radio is None:
        raise BadInput(where, f"{key}.do", f"expected a scenario with a [radio] for {event.do!r}")
    try:
        event.check(scenario.groups())
        event.check_bodies(scenario.groups(), bodies)
        if isinstance(event, Impulse):
            _check_impulse(scenario, bodies, event)
        if event.needs_radio and scenario.radio is not None:
            event.check_radio(scenario.radio)
    except BadInput as error:
        raise BadInput(where, ".".join(part for part in (key, error.key) if part), error.expected) from None

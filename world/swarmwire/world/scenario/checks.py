"""Checks that need more than one key of a scenario: bodies, physics steps, obstacles, the radio's offset, events."""

import math
from collections.abc import Mapping

import numpy as np

from swarmwire.comms.bodies.body import Body
from swarmwire.comms.errors import BadInput
from swarmwire.comms.events.event import Event
from swarmwire.comms.events.robot_events import Push
from swarmwire.comms.radio.config.radio import Radio, check_radio, unfit_for_torus
from swarmwire.world.actuation.noise import noise_of
from swarmwire.world.engines.choice import check_engines, engines_of
from swarmwire.world.placement.layout import read_layout
from swarmwire.world.placement.obstacles import extent, heading_of, obstacle_at
from swarmwire.world.scenario.arena_tables import ObstacleTable
from swarmwire.world.scenario.bodies import bodies_of
from swarmwire.world.scenario.scenario import Scenario

MOST_OF_RADIUS = 0.25  # how far a robot at full speed may move in one physics step


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
    for i, event in enumerate(scenario.events):
        check_event(scenario, bodies, event, f"events.{i}", where)


def _check_steps(scenario: Scenario, bodies: dict[str, Body], where: str) -> None:
    for group, engine in engines_of(scenario, bodies).items():
        body = bodies[group]
        tick_m = body.max_linear_mps * max(1.0, noise_of(body.drive).factor) / scenario.time.rate_hz
        needed = math.ceil(tick_m / (MOST_OF_RADIUS * body.radius_m) - 1e-9)
        if engine != "kinematic" and scenario.physics.steps < needed:
            text = f"so that a robot of {group} at full speed moves at most a quarter of its radius in one step"
            raise BadInput(where, "physics.steps", f"expected at least {needed}, {text}; got {scenario.physics.steps}")


def _check_obstacle(extents_m: tuple[float, float], table: ObstacleTable, key: str, where: str) -> None:
    """A fixed obstacle lies within the arena; a random one would fit into it somewhere at heading 0."""
    size_m = np.array(extents_m)
    least, greatest = extent(obstacle_at(table, *(table.at or (0.0, 0.0)), heading_of(table) or 0.0))
    fits = np.all(greatest - least <= size_m + 2e-9)
    if not fits or (table.at and (np.any(greatest > 0.5 * size_m + 1e-9) or np.any(least < -0.5 * size_m - 1e-9))):
        size = " x ".join(f"{side:g}" for side in size_m)
        raise BadInput(where, key, f"expected the {table.shape} to lie within the arena of {size} m")


def _check_send_offset(scenario: Scenario, where: str) -> None:
    offset, tick_s = scenario.radio.send_offset if scenario.radio else "uniform", 1.0 / scenario.time.rate_hz
    known = offset in ("uniform", "tick") if isinstance(offset, str) else 0.0 <= offset < tick_s
    if not known:
        expected = "expected uniform, tick, or an offset in s from 0 to below the period of a tick"
        raise BadInput(where, "radio.send_offset", f"{expected}; got {offset!r}")


def _check_torus(scenario: Scenario, radio: Radio, where: str) -> None:
    unfit = unfit_for_torus(radio) if scenario.arena.boundary == "torus" else None
    if unfit is not None:
        expected = "expected a disk without bodies_block: what is between two robots across a torus's seam is not known"
        raise BadInput(where, f"radio.{unfit}", expected)


def _check_antennas(scenario: Scenario, where: str) -> None:
    for group, table in scenario.robots.items():
        if table.radio is not None and (scenario.radio is None or not scenario.radio.is_signal):
            why = "a disk knows no strength" if scenario.radio else "there is no [radio]"
            raise BadInput(where, f"robots.{group}.radio", f"expected a radio with signals: {why}")


def _check_push(scenario: Scenario, bodies: Mapping[str, Body], event: Push) -> None:
    """Only engines with forces can push; and who is pushed must not get through what stands in the way in one step."""
    engines = engines_of(scenario, bodies)
    for group in event.robots.groups(scenario.groups()):
        if engines[group] == "kinematic":
            expected = (
                f"expected robots whose bodies have contacts: those of {group} go where they are told (kinematic)"
            )
            raise BadInput("", "robots", expected)
        most_mps = bodies[group].radius_m * scenario.time.rate_hz * scenario.physics.steps
        if event.speed_mps > most_mps:
            why = f"with which a robot of {group} moves by its radius in one of {scenario.physics.steps} physics.steps"
            raise BadInput("", "speed_mps", f"expected at most {most_mps:g} m/s, {why}; got {event.speed_mps!r}")


def check_event(scenario: Scenario, bodies: Mapping[str, Body], event: Event, key: str, where: str) -> None:
    """Raise BadInput unless an event names robots that there are, and fits the radio and the engines that it needs."""
    if event.needs_radio and scenario.radio is None:
        raise BadInput(where, f"{key}.do", f"expected a scenario with a [radio] for {event.do!r}")
    try:
        event.check(scenario.groups())
        event.check_bodies(scenario.groups(), bodies)
        if isinstance(event, Push):
            _check_push(scenario, bodies, event)
        if event.needs_radio and scenario.radio is not None:
            event.check_radio(scenario.radio)
    except BadInput as error:
        raise BadInput(where, ".".join(part for part in (key, error.key) if part), error.expected) from None

"""Which engine moves which group: bodies with contacts are the floor engine's, those without and those that fly not."""

from collections.abc import Mapping

from swarmwire.comms.bodies.body import Body
from swarmwire.comms.errors import BadInput
from swarmwire.world.scenario.scenario import EngineName, Scenario


def engines_of(scenario: Scenario, bodies: Mapping[str, Body]) -> dict[str, EngineName]:
    """The engine of each group, by the group's name."""
    asked = scenario.physics.engine
    floor: EngineName = asked if asked != "auto" else "pymunk" if movable_in(scenario) else "discs"
    return {name: floor if body.contacts and body.altitude_m == 0.0 else "kinematic" for name, body in bodies.items()}


def movable_in(scenario: Scenario) -> list[int]:
    """The places of movable obstacles among the scenario's."""
    return [i for i, table in enumerate(scenario.arena.obstacles) if table.movable]


def check_engines(scenario: Scenario, bodies: Mapping[str, Body], where: str) -> None:
    """Raise BadInput if an engine cannot do what the arena asks of it."""
    engines = engines_of(scenario, bodies)
    movable = movable_in(scenario)
    if movable and scenario.physics.engine == "discs":
        expected = f"expected auto or pymunk: discs moves no obstacles, and arena.obstacles.{movable[0]} is movable"
        raise BadInput(where, "physics.engine", expected)
    if movable and "pymunk" not in engines.values():
        expected = "expected a robot with contacts that could push it: all robots are moved without contacts"
        raise BadInput(where, f"arena.obstacles.{movable[0]}.movable", expected)
    asked = scenario.physics.engine
    if asked != "auto" and asked not in engines.values():
        why = ", ".join(f"{name} {_why_not(bodies[name])}" for name in engines)
        raise BadInput(
            where, "physics.engine", f"expected auto or kinematic: no robot could be moved by {asked}: {why}"
        )
    stuck = [group for group, engine in engines.items() if engine != "kinematic"]
    if scenario.arena.boundary == "torus" and stuck:
        body = bodies[stuck[0]].name
        expected = f"expected walls or open: on a torus no robot has contacts, and {body} (robots.{stuck[0]}) does"
        raise BadInput(
            where, "arena.boundary", f'{expected}; physics.engine = "kinematic" takes them all off the floor'
        )


def _why_not(body: Body) -> str:
    """Why the kinematic engine alone can move a body."""
    return "flies" if body.altitude_m > 0.0 else "has no contacts"

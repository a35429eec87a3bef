"""A push changes velocities at once in every engine that knows forces; motors, brakes and walls do the rest."""

from typing import Any

import numpy as np
import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.world.live_events import LiveEvents
from swarmwire.world.loop import Loop
from swarmwire.world.scenario_file import scenario_from
from swarmwire.world.world import World
from tests.support.world.samples import changed, posed
from tests.unit.world.test_event_scheduler import Ahead, Watch

ENGINES = ["discs", "pymunk"]


def pushed(
    poses: Any, engine: str, ticks: int = 20, body: str = "footbot", speed_mps: float = 0.4, **keys: Any
) -> Watch:
    """Robots at rest, whose first one is pushed in tick 2, as a scenario's event or a given one would."""
    robots = keys.pop("robots", {"names": ["a-0"]})
    event = {"do": "impulse", "at_s": 0.2, "robots": robots, "speed_mps": speed_mps, **keys}
    scenario = posed(poses, body, events=[event], physics={"engine": engine})
    watch = Watch()
    Loop(World(scenario, [1], {}), None, Ahead(0.0), [watch], scenario.events).run(ticks)
    return watch


@pytest.mark.parametrize("engine", ENGINES)
def test_a_push_is_a_velocity_that_motors_take_back(engine):
    seen = pushed([[0.0, 0.0, 0.3], [1.0, 0.0, 0.0]], engine, direction_rad=np.pi / 2).seen
    assert np.allclose(seen[1].velocity, 0.0)
    assert np.allclose(seen[2].velocity[0], [0.0, 0.4, 0.0], atol=1e-12)
    assert not seen[2].velocity[1].any()
    [happened] = seen[2].events
    assert (happened.do, happened.ended, happened.changed.tolist()) == ("impulse", False, [True, False])
    assert seen[-1].pose[0, 1] > 0.0005
    assert np.allclose(seen[-1].velocity, 0.0, atol=1e-9)


@pytest.mark.parametrize("engine", ENGINES)
def test_pushes_of_one_tick_add_up(engine):
    events = [
        {"do": "impulse", "at_s": 0.0, "robots": {"group": "a"}, "speed_mps": speed, "direction_rad": direction}
        for speed, direction in ((0.3, 0.0), (0.1, np.pi))
    ]
    scenario = posed([[0.0, 0.0, 0.0]], "footbot", events=events, physics={"engine": engine})
    watch = Watch()
    Loop(World(scenario, [1], {}), None, Ahead(0.0), [watch], scenario.events).run(1)
    assert np.allclose(watch.seen[0].velocity[0], [0.2, 0.0, 0.0])


@pytest.mark.parametrize("engine", ENGINES)
def test_who_is_pushed_at_full_allowance_gets_through_no_wall_and_no_robot(engine):
    """A radius per physics step is the most: 0.085 m in 0.02 s."""
    seen = pushed([[1.8, 0.0, 0.0], [1.0, 0.0, 0.0]], engine, speed_mps=4.25).seen
    assert max(truth.pose[0, 0] for truth in seen) < 2.0
    assert sum(truth.contact_onsets[0, 1] for truth in seen) >= 1
    seen = pushed([[-1.0, 0.0, 0.0], [-0.8, 0.0, 0.0]], engine, speed_mps=4.25).seen
    assert all(truth.pose[0, 0] < truth.pose[1, 0] for truth in seen)
    assert sum(truth.contact_onsets[0, 0] for truth in seen) >= 1


@pytest.mark.parametrize("engine", ENGINES)
def test_the_dead_are_pushed_too_and_drawn_robots_are_alive(engine):
    seen = pushed([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], engine, robots={"group": "a"}).seen
    assert seen[2].velocity[:, 0].tolist() == [0.4, 0.4]


def test_an_arena_with_a_push_is_the_same_alone_and_among_others():
    event = {"do": "impulse", "at_s": 0.2, "robots": {"count": 1}, "speed_mps": 0.4}
    scenario = posed([[0.0, 0.0, 0.3], [0.3, 0.0, 0.0]], "footbot", events=[event])
    digests = []
    for seeds in ([5], [1, 5, 9]):
        loop = Loop(World(scenario, seeds, {}), None, Ahead(0.1), [], scenario.events)
        loop.run(20)
        digests.append(loop.hexdigests()[seeds.index(5)])
    assert digests[0] == digests[1]


def test_bodies_that_go_where_they_are_told_cannot_be_pushed_and_it_is_said_at_the_door():
    event = {"do": "impulse", "at_s": 0.2, "robots": {"group": "flock"}, "speed_mps": 0.4}
    mapping = changed("events", [event])
    mapping["physics"] = {"engine": "kinematic"}
    with pytest.raises(
        BadInput, match="events.0.robots: expected robots whose bodies have contacts: those of flock go"
    ):
        scenario_from(mapping, "s.toml")
    world = World(posed([[0.0, 0.0, 0.0]], physics={"engine": "kinematic"}), [1], {})
    with pytest.raises(TypeError, match="knows no forces"):
        world.apply_impulse(np.ones((1, 2)))


def test_of_engines_side_by_side_only_the_one_with_forces_pushes():
    mapping = changed("physics", {"engine": "auto"})
    mapping["robots"]["big"]["body"] = "point"
    mapping["events"] = [{"do": "impulse", "at_s": 0.0, "robots": {"names": ["flock-2"]}, "speed_mps": 0.4}]
    scenario = scenario_from(mapping, "s.toml")
    world, watch = World(scenario, [1], {}), Watch()
    assert set(world.engines) == {"discs", "kinematic"}
    Loop(world, None, Ahead(0.0), [watch], scenario.events, live_events=LiveEvents(scenario, {})).run(2)
    assert watch.seen[0].velocity[:, 0].tolist() == [0.4 if row == 2 else 0.0 for row in range(15)]

"""The world keeps to its contract: rows, needs, commands, and the same bits alone or beside other arenas."""

import numpy as np
import pytest

from swarmwire.comms.draws import derive_key
from swarmwire.comms.errors import BadInput
from swarmwire.comms.tick_io import Actions
from swarmwire.world.scenario_file import scenario_from
from swarmwire.world.world import World
from tests.support.world.samples import ALL_SENSORS, SAMPLE, changed, commanded, posed, wandering


def sample_world(*seeds: int) -> World:
    return World(scenario_from(SAMPLE, "f"), seeds, ALL_SENSORS)


def test_an_arena_runs_alike_alone_and_beside_seven_others() -> None:
    many = sample_world(*range(8))
    alone = [sample_world(seed) for seed in (2, 7)]
    robots = many.static.robots
    for tick in range(60):
        readings = many.sense(tick)
        onsets = many.move(wandering(many, tick))
        for world, arena in zip(alone, (2, 7), strict=True):
            rows = slice(arena * robots, (arena + 1) * robots)
            for group, own in world.sense(tick).items():
                of_arena = readings[group].rows // robots == arena
                assert np.array_equal(readings[group].rows[of_arena] - arena * robots, own.rows)
                assert own.fields.keys() == readings[group].fields.keys()
                for field, values in own.fields.items():
                    assert np.array_equal(readings[group].fields[field][of_arena], values), (field, tick)
            assert np.array_equal(world.move(wandering(world, tick))[0], onsets[arena])
            assert np.array_equal(world.pose, many.pose[rows])
            assert np.array_equal(world.velocity, many.velocity[rows])
            assert np.array_equal(world.command, many.command[rows])
    assert many.keys.tolist() == [derive_key("arena", seed) for seed in range(8)]


def test_contacts_happen_in_that_run() -> None:
    """The equality above would mean less without them."""
    world = sample_world(2)
    assert sum(world.move(wandering(world, tick)) for tick in range(60)).sum() > 0


def test_senses_have_a_row_per_robot_of_the_group_over_all_arenas() -> None:
    world = sample_world(1, 2)
    readings = world.sense(0)
    assert readings["flock"].rows.tolist() == [*range(12), *range(15, 27)]
    assert readings["big"].rows.tolist() == [12, 13, 14, 27, 28, 29]
    shapes = {name: field.shape for name, field in readings["big"].fields.items()}
    assert shapes == {
        "proximity.value": (6, 24),
        "compass.heading_rad": (6,),
        "odometry.left_m": (6,),
        "odometry.right_m": (6,),
        "light.value": (6, 24),
        "bumper.pressed": (6,),
    }
    for name, field in readings["flock"].fields.items():
        assert field.flags.c_contiguous, name
        assert field.dtype == np.float64, name


def test_only_what_is_needed_is_sensed() -> None:
    scenario = scenario_from(SAMPLE, "f")
    world = World(scenario, [1], {"flock": ("compass", "radio.range"), "big": ()})
    readings = world.sense(0)
    assert list(readings["flock"].fields) == ["compass.heading_rad"]
    assert readings["big"].fields == {}


def test_a_sense_that_the_body_lacks_is_refused() -> None:
    has = "the body epuck has proximity, compass, odometry, light, ground, camera, bumper"
    text = f"^f: robots.flock.agent: the agent needs the sense 'sonar'; {has}$"
    with pytest.raises(BadInput, match=text):
        World(scenario_from(SAMPLE, "f"), [1], {"flock": ("sonar",)})


def test_static_says_what_the_scenario_says() -> None:
    static = sample_world(4, 5).static
    assert (static.name, static.seeds, static.rate_hz, static.walled) == ("sample", (4, 5), 10, True)
    assert (static.arenas, static.robots, static.range_m) == (2, 15, 2.0)
    assert [(g.name, g.body.name, g.start, g.stop) for g in static.groups] == [
        ("flock", "epuck", 0, 12),
        ("big", "footbot", 12, 15),
    ]
    assert static.robot_names[:2] == ("flock-0", "flock-1")
    assert [o.shape for o in static.obstacles[0]] == ["cylinder"] * 4 + ["box"] + ["polygon"] * 2
    assert [[light.intensity_m for light in some] for some in static.lights] == [[2.0, 2.0]] * 2
    assert World(scenario_from(changed("arena.boundary", "open"), "f"), [1], {}).static.walled is False


def test_robots_without_a_command_keep_the_last_one() -> None:
    world = World(posed([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), [1], {})
    world.move(commanded(world, [0.05, 0.06, 0.07], 0.0))
    rows = np.array([2, 0])
    world.move(Actions(rows, np.array([True, False]), np.array([0.01, 0.02]), np.array([0.5, 0.6]), np.zeros(2)))
    assert world.command.tolist() == [[0.05, 0.0, 0.0], [0.06, 0.0, 0.0], [0.01, 0.5, 0.0]]


def test_commands_that_are_not_finite_are_dropped_and_counted() -> None:
    world = World(posed([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), [1], {})
    world.move(commanded(world, 0.05, 0.1))
    world.move(commanded(world, [np.nan, 0.01, 0.02], [0.0, np.inf, 0.3]))
    assert world.command.tolist() == [[0.05, 0.1, 0.0], [0.05, 0.1, 0.0], [0.02, 0.3, 0.0]]
    assert world.counts()["nan_commands"].tolist() == [2]
    assert world.counts()["clipped_commands"].tolist() == [0]
    unasked = commanded(world, np.nan, 0.0)
    world.move(Actions(unasked.rows, ~unasked.drive, unasked.linear_mps, unasked.angular_radps, unasked.lateral_mps))
    assert world.counts()["nan_commands"].tolist() == [2]


def test_arrays_of_a_tick_are_not_written_to_later() -> None:
    world = sample_world(1)
    kept = world.pose, world.velocity, world.command
    copies = [array.copy() for array in kept]
    for tick in range(3):
        world.move(wandering(world, tick))
    assert all(np.array_equal(array, copy) for array, copy in zip(kept, copies, strict=True))
    assert np.all((world.pose[:, 2] > -np.pi) & (world.pose[:, 2] <= np.pi))


def test_a_world_has_an_arena() -> None:
    with pytest.raises(BadInput, match="expected at least one seed"):
        World(scenario_from(SAMPLE, "f"), [], {})

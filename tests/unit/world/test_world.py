"""The world."""

import hashlib
from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.robot.packets import ReceivedPackets
from swarmwire.comms.robot.tick_io import MAX_STATES, NOTHING_SET, Actions, SparseTable
from swarmwire.world import trajectory_hash
from swarmwire.world.annotations import LatestValues, States
from swarmwire.world.scenario_file import scenario_from
from swarmwire.world.trajectory_hash import TrajectoryHash
from swarmwire.world.world import World
from tests.support.refusals import refused_input
from tests.support.world.scenes import ALL_SENSORS, SAMPLE, changed, commanded, posed, wandering

POSES = [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
ALIVE = np.ones(6, np.bool_)
ALL_FOUR = np.ones(4, np.bool_)
ARENAS, ROBOTS, TICKS = 3, 2, 9
ROWS = ARENAS * ROBOTS


def sample_world(*seeds: int) -> World:
    return World(scenario_from(SAMPLE, "f"), seeds, ALL_SENSORS)


def test_radio_poses_have_the_heights_of_bodies_until_others_are_set() -> None:
    group = {"count": 1, "agent": "x"}
    robots = {"low": {**group, "body": "epuck"}, "high": {**group, "body": "crazyflie"}}
    world = World(posed([], robots=robots), [1, 2], {})
    assert world.radio_pose[:, 3].tolist() == [0.0, 0.5] * 2
    assert np.array_equal(world.radio_pose[:, :3], world.pose)
    before = world.radio_pose
    world.altitude_m[1] = 2.0, 3.0
    world.move(commanded(world, 0.0, 0.0))
    assert world.radio_pose[:, 3].tolist() == [0.0, 0.5, 2.0, 3.0]
    assert before[:, 3].tolist() == [0.0, 0.5] * 2


def test_readings_have_a_row_per_robot_of_the_group_in_all_arenas() -> None:
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


def test_world_reads_only_the_needed_sensors() -> None:
    scenario = scenario_from(SAMPLE, "f")
    world = World(scenario, [1], {"flock": ("compass", "radio.range"), "big": ()})
    readings = world.sense(0)
    assert list(readings["flock"].fields) == ["compass.heading_rad"]
    assert readings["big"].fields == {}


def test_sensor_that_the_body_lacks_is_refused() -> None:
    with refused_input("f", "robots.flock.agent", "'sonar'; the body epuck has proximity, .*, bumper$"):
        World(scenario_from(SAMPLE, "f"), [1], {"flock": ("sonar",)})


def test_static_has_the_values_of_the_scenario() -> None:
    static = sample_world(4, 5).static
    assert (static.name, static.seeds, static.rate_hz, static.walled) == ("sample", (4, 5), 10, True)
    assert (static.arenas, static.robots, static.range_m) == (2, 15, 2.0)
    assert [(g.name, g.body.name, g.start, g.stop) for g in static.groups] == [
        ("flock", "epuck", 0, 12),
        ("big", "footbot", 12, 15),
    ]
    assert static.robot_names[:2] == ("flock-0", "flock-1")
    assert [o.shape for o in static.obstacles[0]] == ["cylinder"] * 4 + ["box"] + ["polygon"] * 2
    assert [[light.intensity_m for light in lights] for lights in static.lights] == [[2.0, 2.0]] * 2
    assert World(scenario_from(changed("arena.boundary", "open"), "f"), [1], {}).static.walled is False


def test_robots_without_a_command_keep_the_last_one() -> None:
    world = World(posed([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), [1], {})
    world.move(commanded(world, [0.05, 0.06, 0.07], 0.0))
    rows = np.array([2, 0])
    world.move(Actions(rows, np.array([True, False]), np.array([0.01, 0.02]), np.array([0.5, 0.6]), np.zeros(2)))
    assert world.command.tolist() == [[0.05, 0.0, 0.0], [0.06, 0.0, 0.0], [0.01, 0.5, 0.0]]


def test_arrays_of_a_tick_are_not_written_to_later() -> None:
    world = sample_world(1)
    arrays = world.pose, world.velocity, world.command
    copies = [array.copy() for array in arrays]
    for tick in range(3):
        world.move(wandering(world, tick))
    assert all(np.array_equal(array, copy) for array, copy in zip(arrays, copies, strict=True))
    assert np.all((world.pose[:, 2] > -np.pi) & (world.pose[:, 2] <= np.pi))


def test_world_without_a_seed_is_refused() -> None:
    with pytest.raises(BadInput, match="expected at least one seed"):
        World(scenario_from(SAMPLE, "f"), [], {})


def moved(failed: dict[str, np.ndarray], ticks: int = 20) -> World:
    world = World(posed(POSES), [1], {"a": ("proximity", "compass")})
    world.set_failed(failed)
    for _ in range(ticks):
        world.move(commanded(world, 0.1, 0.0))
    return world


def test_failed_motors_brake_and_the_others_go_on():
    world = moved({"motors": np.array([True, False])})
    assert np.abs(world.pose[0] - POSES[0]).max() < 1e-9
    assert world.pose[1, 0] > POSES[1][0] + 0.15


@pytest.mark.parametrize(("part", "sign"), [("left_wheel", 1.0), ("right_wheel", -1.0)])
def test_robot_turns_around_its_failed_wheel(part: str, sign: float):
    world = moved({part: np.array([True, False])})
    base_m = world.static.groups[0].body.wheels.wheel_base_m
    assert world.velocity[0, 2] == pytest.approx(sign * 0.1 / base_m, rel=1e-3)
    # The wheel that stands still is the centre of the circle.
    assert np.hypot(*(world.pose[0, :2] - [-1.0, sign * base_m / 2])) == pytest.approx(base_m / 2, rel=0.05)


def test_failed_compass_reads_blank_until_it_is_repaired():
    world = moved({"compass": np.array([True, False])}, ticks=1)
    heading = world.sense(1)["a"].fields["compass.heading_rad"]
    assert np.isnan(heading[0])
    assert np.isfinite(heading[1])
    world.set_failed({})
    assert np.isfinite(world.sense(2)["a"].fields["compass.heading_rad"]).all()


def notes(*named: tuple[int, str]) -> SparseTable:
    names = tuple(dict.fromkeys(state for _, state in named))
    rows = np.array([row for row, _ in named], np.int64)
    return SparseTable(rows, np.zeros_like(rows), np.array([names.index(state) for _, state in named], float), names)


def shown(states: States) -> list[str]:
    return [states.names[code] for code in states.code]


def test_state_holds_until_the_next_note():
    states = States(1, 6)
    states.update(notes((1, "search"), (4, "wait")), ALIVE)
    before, codes = states.code, states.code.tolist()
    states.update(notes((4, "search")), ALIVE)
    assert shown(states) == ["", "search", "", "", "search", ""]
    assert before.tolist() == codes  # published arrays do not change


def test_state_codes_follow_the_rows_of_the_notes():
    together, joined = States(1, 6), States(1, 6)
    together.update(notes((5, "c"), (0, "b"), (3, "a")), ALIVE)
    joined.update(SparseTable.joined([notes((3, "a")), notes((5, "c"), (0, "b"))]), ALIVE)
    assert together.names == joined.names == ("", "b", "a", "c")
    assert together.code.tolist() == joined.code.tolist()


def test_state_of_a_dead_robot_is_ignored_and_cleared():
    states, dead = States(1, 6), ALIVE.copy()
    dead[2] = False
    states.update(notes((2, "search"), (3, "search")), dead)
    assert shown(states) == ["", "", "", "search", "", ""]
    states.clear(np.arange(6) == 3)
    assert shown(states) == [""] * 6


def test_state_limit_is_counted_for_each_arena():
    states = States(2, 3)
    for i in range(MAX_STATES + 2):
        states.update(notes((0, f"a{i}"), (4, f"b{i % 3}")), ALIVE)
    states.update(notes((1, "b0"), (5, "a0"), (3, "new")), ALIVE)
    assert states.dropped.tolist() == [3, 0]
    assert shown(states)[1] == ""
    assert shown(states)[3:] == ["new", f"b{(MAX_STATES + 1) % 3}", "a0"]
    assert len(set(states.names)) == len(states.names)


def noted_values(*numbers: tuple[int, float]) -> SparseTable:
    rows, value = zip(*numbers, strict=True)
    return SparseTable(np.array(rows, np.int64), np.zeros(len(rows), np.int64), np.array(value, np.float64))


def shown_values(values: LatestValues) -> list[float | None]:
    assert values.value is not None
    return [None if np.isnan(value) else float(value) for value in values.value]


def test_noted_value_holds_until_the_next_note() -> None:
    values = LatestValues()
    values.update(NOTHING_SET, ALL_FOUR)
    assert values.value is None
    values.update(noted_values((1, 2.5), (3, -1.0)), ALL_FOUR)
    before = values.value
    values.update(SparseTable.joined([noted_values((3, 7.0)), NOTHING_SET, noted_values((0, 5.0), (3, 0.0))]), ALL_FOUR)
    values.update(NOTHING_SET, ALL_FOUR)
    assert shown_values(values) == [5.0, 2.5, None, 0.0]
    assert before is not None
    assert before[3] == -1.0  # published arrays do not change


def test_noted_value_of_a_dead_robot_is_ignored_and_cleared() -> None:
    values, dead = LatestValues(), ALL_FOUR.copy()
    dead[2] = False
    values.clear(~dead)
    values.update(noted_values((2, 1.0)), dead)
    assert values.value is None
    values.update(noted_values((2, 1.0), (3, 1.0)), dead)
    assert shown_values(values) == [None, None, None, 1.0]
    values.clear(np.arange(4) == 3)
    assert shown_values(values) == [None] * 4


def moved_at(tick: int) -> list[np.ndarray]:
    return [np.arange(ROWS * 3.0).reshape(ROWS, 3) + 100.0 * tick + kind for kind in (0.1, 0.2, 0.3)]


def received(tick: int, open_arenas: list[int]) -> ReceivedPackets:
    """Packets of a tick: every third tick one for a robot of each open arena."""
    if tick % 3:
        return ReceivedPackets.none()
    receiver = np.array([arena * ROBOTS + 1 for arena in open_arenas], np.int64)
    zeros = np.zeros(len(receiver), np.int64)
    return replace(
        ReceivedPackets.none(),
        receiver=receiver,
        sender_index=zeros,
        sequence=zeros + tick,
        received_at_ns=zeros + 7,
        payload=zeros,
    )


def expected(closed_after: dict[int, int]) -> list[str]:
    digests = [hashlib.sha256() for _ in range(ARENAS)]
    for tick in range(TICKS):
        for arena in range(ARENAS):
            if tick > closed_after.get(arena, TICKS):
                continue
            rows = slice(arena * ROBOTS, (arena + 1) * ROBOTS)
            digests[arena].update(np.concatenate(moved_at(tick), axis=1)[rows].tobytes())
            if tick % 3 == 0:
                digests[arena].update(np.array([1, 0, tick, 7], np.int64).tobytes())
    return [digest.hexdigest() for digest in digests]


@pytest.mark.parametrize("waiting_bytes", [1, 1000, 2**20])
@pytest.mark.parametrize("closed_after", [{}, {1: 3}, {0: 0, 2: 4}, {0: 2, 1: 2, 2: 7}])
def test_trajectory_hash_does_not_depend_on_the_ticks_hashed_at_once(waiting_bytes, closed_after, monkeypatch):
    monkeypatch.setattr(trajectory_hash, "MAX_PENDING_BYTES", waiting_bytes)
    digest, running = TrajectoryHash(ARENAS, ROBOTS), list(range(ARENAS))
    for tick in range(TICKS):
        digest.add(*moved_at(tick), received(tick, running))
        over = [arena for arena in running if closed_after.get(arena, TICKS) == tick]
        if over:
            digest.close(np.isin(np.arange(ARENAS), over))
            running = [arena for arena in running if arena not in over]
    assert digest.hexdigests() == expected(closed_after)


def test_trajectory_hash_is_unchanged_by_reading_it():
    polled, plain = TrajectoryHash(ARENAS, ROBOTS), TrajectoryHash(ARENAS, ROBOTS)
    for tick in range(TICKS):
        for digest in (polled, plain):
            digest.add(*moved_at(tick), received(tick, list(range(ARENAS))))
        polled.hexdigests()
    assert polled.hexdigests() == plain.hexdigests() == expected({})

"""Robots follow commands within the limits of their wheels, stop at what they hit, and contacts are counted once."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.bodies.body import load_body
from swarmwire.world.world import World
from tests.support.world.samples import commanded, posed

EPUCK, FOOTBOT = load_body("epuck"), load_body("footbot")
CLOSING_STEPS = [2, 3, 5, 10, 20]


def overlaps_of_a_crash(body: str, steps: int, poses: list[list[float]]) -> tuple[list[float], np.ndarray]:
    """Overlap after each tick of two robots, or of one with the right wall, at full speed; contacts that began."""
    scenario = posed(poses, body, physics={"steps": steps})
    world = World(scenario, [1], {})
    kind = load_body(body)
    overlaps: list[float] = []
    onsets = np.zeros(2, np.int64)
    for _ in range(60):
        onsets += world.move(commanded(world, kind.max_linear_mps, 0.0))[0]
        if len(poses) == 2:
            overlaps.append(2 * kind.radius_m - float(np.hypot(*(world.pose[0, :2] - world.pose[1, :2]))))
        else:
            overlaps.append(float(world.pose[0, 0]) + kind.radius_m - 2.0)
    return overlaps, onsets


@pytest.mark.parametrize("body", ["epuck", "footbot"])
@pytest.mark.parametrize("steps", CLOSING_STEPS)
@pytest.mark.parametrize("gap_m", [0.1, 0.107, 0.1113])
def test_robots_that_drive_at_each_other_stop_at_contact(body: str, steps: int, gap_m: float) -> None:
    kind = load_body(body)
    x = kind.radius_m + 0.5 * gap_m
    overlaps, onsets = overlaps_of_a_crash(body, steps, [[-x, 0.0, 0.0], [x, 0.0, np.pi]])
    closing_m = 2.0 * kind.max_linear_mps * 0.1 / steps
    assert max(overlaps) <= 1.2 * closing_m
    assert max(overlaps[-20:]) <= 0.02 * kind.radius_m
    assert onsets.tolist() == [1, 0]


@pytest.mark.parametrize("body", ["epuck", "footbot"])
@pytest.mark.parametrize("steps", CLOSING_STEPS)
def test_a_robot_that_drives_at_a_wall_stops_there(body: str, steps: int) -> None:
    kind = load_body(body)
    overlaps, onsets = overlaps_of_a_crash(body, steps, [[1.8 - kind.radius_m, 0.3, 0.0]])
    assert max(overlaps) <= 1.2 * kind.max_linear_mps * 0.1 / steps
    assert -0.01 * kind.radius_m <= overlaps[-1]
    assert max(overlaps[-20:]) <= 0.02 * kind.radius_m
    assert onsets.tolist() == [0, 1]


WALL = [[-0.3, -0.5], [0.1, -0.5], [0.1, 0.5], [-0.3, 0.5]]


@pytest.mark.parametrize(
    "shape",
    [
        {"shape": "cylinder", "radius_m": 0.3},
        {"shape": "box", "size_m": [0.6, 0.6]},
        {"shape": "polygon", "points": WALL},
    ],
)
def test_obstacles_hold_robots_back(shape: dict[str, object]) -> None:
    arena = {"size_m": [4.0, 4.0], "obstacles": [{**shape, "at": [0.0, 0.0]}]}
    world = World(posed([[-0.5, 0.0, 0.0]], arena=arena), [1], {})
    onsets = sum(world.move(commanded(world, 0.12, 0.0)) for _ in range(40))
    assert world.pose[0, 0] == pytest.approx(-0.3 - EPUCK.radius_m, abs=0.02 * EPUCK.radius_m)
    assert np.array_equal(onsets, [[0, 1]])


def test_a_polygon_with_a_box_s_corners_moves_robots_as_the_box_does() -> None:
    square = [[-0.3, -0.3], [0.3, -0.3], [0.3, 0.3], [-0.3, 0.3]]
    worlds = [
        World(posed([[-0.5, 0.1, 0.1]], arena={"size_m": [4.0, 4.0], "obstacles": [shape]}), [1], {})
        for shape in (
            {"shape": "box", "size_m": [0.6, 0.6], "heading_rad": 0.2, "at": [0.0, 0.0]},
            {"shape": "polygon", "points": square, "heading_rad": 0.2, "at": [0.0, 0.0]},
        )
    ]
    for _ in range(60):
        onsets = [world.move(commanded(world, 0.12, 0.0)) for world in worlds]
        assert np.array_equal(*onsets)
        assert np.array_equal(worlds[0].pose, worlds[1].pose)


def test_an_open_arena_holds_nobody_back() -> None:
    world = World(posed([[1.9, 0.0, 0.0]], arena={"size_m": [4.0, 4.0], "boundary": "open"}), [1], {})
    for _ in range(40):
        assert not world.move(commanded(world, 0.12, 0.0)).any()
    assert world.pose[0, 0] > 2.2


@pytest.mark.parametrize("steps", CLOSING_STEPS)
@given(linear=st.floats(-0.08, 0.08), angular=st.floats(-1.5, 1.5), heading=st.floats(-3.1, 3.1))
def test_a_robot_drives_the_arc_that_its_command_describes(
    steps: int, linear: float, angular: float, heading: float
) -> None:
    world = World(posed([[0.0, 0.0, heading]], physics={"steps": steps}), [1], {})
    for _ in range(3):  # reaches its speed
        world.move(commanded(world, linear, angular))
    x, y, start = world.pose[0]
    for _ in range(10):
        world.move(commanded(world, linear, angular))
    turn = angular * 1.0
    chord = linear * 1.0 * np.sinc(turn / (2 * np.pi))
    at = x + chord * np.cos(start + turn / 2), y + chord * np.sin(start + turn / 2)
    # The path of k steps is k chords, each longer than its own by (turn per step)^2 / 24.
    slack = 1e-9 + abs(linear) * (angular * 0.1 / steps) ** 2 / 20
    assert world.pose[0, :2] == pytest.approx(at, abs=slack)
    assert np.angle(np.exp(1j * (world.pose[0, 2] - start - turn))) == pytest.approx(0.0, abs=1e-9)
    assert world.velocity[0, 2] == pytest.approx(angular)
    assert np.hypot(*world.velocity[0, :2]) == pytest.approx(abs(linear))


def test_speed_builds_up_with_the_motors_force() -> None:
    world = World(posed([[0.0, 0.0, 0.0]], physics={"steps": 50}), [1], {})
    world.move(commanded(world, EPUCK.max_linear_mps, 0.0))
    # At 1.5 N on 0.4 kg it takes 34 ms to full speed; until then half of the way is lost, and the first step of 2 ms.
    lost_s = 0.5 * EPUCK.max_linear_mps * EPUCK.mass_kg / EPUCK.drive.max_force_n
    assert world.pose[0, 0] == pytest.approx(EPUCK.max_linear_mps * (0.1 - lost_s), abs=0.002 * EPUCK.max_linear_mps)


@given(linear=st.floats(-1e3, 1e3), angular=st.floats(-1e3, 1e3))
def test_commands_are_scaled_to_the_wheels_limit_along_the_same_curve(linear: float, angular: float) -> None:
    world = World(posed([[0.0, 0.0, 0.0]]), [1], {})
    world.move(commanded(world, linear, angular))
    drive = EPUCK.drive
    wheel = abs(linear) + 0.5 * abs(angular) * drive.wheel_base_m
    applied = world.command[0]
    assert abs(applied[0]) + 0.5 * abs(applied[1]) * drive.wheel_base_m <= drive.max_wheel_mps * (1 + 1e-8)
    assert applied[0] * angular == pytest.approx(applied[1] * linear)
    assert world.counts()["clipped_commands"].tolist() == [wheel > drive.max_wheel_mps * (1 + 1e-9)]
    if wheel <= drive.max_wheel_mps:
        assert applied.tolist() == [linear, angular, 0.0]


def test_the_full_speed_of_the_sheet_is_not_clipped() -> None:
    world = World(posed([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), [1], {})
    world.move(commanded(world, [EPUCK.max_linear_mps, 0.0], [0.0, -EPUCK.max_angular_radps]))
    assert not any(counts.any() for counts in world.counts().values())


@pytest.mark.parametrize("steps", [3, 10])
@pytest.mark.parametrize("offset_m", [0.0, 0.02, 0.05, 0.07, 0.08])
def test_a_contact_begins_once_however_long_it_lasts(steps: int, offset_m: float) -> None:
    """Foot-bots that push and slide along each other lose touch by micrometres; that begins no new contact."""
    poses = [[-0.3, offset_m, 0.0], [0.3, -offset_m, np.pi]]
    world = World(posed(poses, "footbot", physics={"steps": steps}), [1], {})
    assert np.array_equal(sum(world.move(commanded(world, 0.2, 0.0)) for _ in range(30)), [[1, 0]])


def test_robots_that_part_and_meet_again_begin_a_contact_anew() -> None:
    world = World(posed([[-0.2, 0.0, 0.0], [0.2, 0.0, np.pi]]), [1], {})
    for linear_mps, began in ((0.1, 1), (-0.05, 0), (0.1, 1)):
        assert np.array_equal(sum(world.move(commanded(world, linear_mps, 0.0)) for _ in range(30)), [[began, 0]])


def test_a_robot_that_is_pushed_off_its_centre_keeps_its_heading() -> None:
    world = World(posed([[-0.3, 0.02, 0.0], [0.3, -0.02, np.pi]], "footbot"), [1], {})
    for _ in range(40):
        world.move(commanded(world, 0.2, 0.0))
    assert abs(world.pose[0, 2]) < np.deg2rad(3)
    assert abs(world.velocity[0, 2]) < 1e-3


def test_a_dense_crowd_stays_apart_and_inside() -> None:
    group = {"body": "footbot", "count": 150, "agent": "x", "place": {"how": "arena"}}
    scenario = posed([[0, 0, 0]], arena={"size_m": [4.0, 4.0]}, robots={"a": group})
    world = World(scenario, [1], {})
    r = FOOTBOT.radius_m
    for _ in range(100):
        world.move(commanded(world, 0.1, 0.0))
    xy = world.pose[:, :2]
    distance = np.hypot(*(xy[:, None] - xy).transpose(2, 0, 1)) + 10.0 * np.eye(len(xy))
    assert 2 * r - distance.min() < 0.06 * r
    assert np.abs(xy).max() + r - 2.0 < 0.03 * r

"""Heavy robots that press light ones against what cannot move."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.comms.robot.bodies.drives import wheel_base_of
from swarmwire.world.engines.discs.engine import DiscsEngine
from swarmwire.world.engines.engine import Engine
from swarmwire.world.engines.pymunk_engine import PymunkEngine
from tests.support.world.engines.conformance import FLOOR, Make, build_engine, overlap_m, targets, towards

MAX_OVERLAP_M = 1e-3  # limit for bodies at rest, see docs/limits.md
SIZE_M = (3.0, 2.0)
# What stands, and how far along x its face is where the robots meet it.
STANDING: dict[str, tuple[tuple[Obstacle, ...], float]] = {
    "wall": ((), 1.5),
    "box": ((Obstacle("box", 1.2, 0.0, size_m=(0.4, 0.6)),), 1.0),
    "cylinder": ((Obstacle("cylinder", 1.2, 0.0, radius_m=0.2),), 1.0),
}
LINES = [  # outwards from the obstacle; the last robot drives
    ["kilobot", "footbot"],  # 1 to 160 by mass
    ["kilobot", "turtlebot3-burger"],  # 1 to 100
    ["kilobot", "turtlebot4"],  # 1 to 395
    ["epuck", "footbot"],  # 1 to 4
    ["epuck", "epuck", "epuck", "footbot"],
    ["kilobot", "kilobot", "kilobot", "footbot"],
    ["kilobot", "footbot", "kilobot", "footbot"],
    ["footbot", "footbot"],
]


def engine_of(make: Make, names: Sequence[str], pose: Any, **more: Any) -> tuple[Engine, FloatArray]:
    """An engine of these bodies at pose (n, 3) or (arenas, n, 3), and their radii (n,)."""
    bodies = [load_body(name) for name in names]
    radius_m = np.array([body.radius_m for body in bodies])
    motors = {
        "mass_kg": np.array([body.mass_kg for body in bodies]),
        "max_force_n": np.array([body.drive.max_force_n for body in bodies]),
        "max_torque_nm": np.array([body.drive.max_torque_nm for body in bodies]),
        "wheel_base_m": np.array([wheel_base_of(body.drive) for body in bodies]),
    }
    return build_engine(make, pose, radius_m=radius_m, **motors, **more), radius_m


def line_poses(names: Sequence[str], face_m: float, run_up_m: float = 0.1) -> FloatArray:
    """Poses (n, 3) of robots that touch one another in a line from a face, but the last, which has a run-up."""
    radius_m = np.array([load_body(name).radius_m for name in names])
    x_m = face_m - 2.0 * np.cumsum(radius_m) + radius_m
    x_m[-1] -= run_up_m
    return np.column_stack([x_m, np.zeros((len(names), 2))])


def press(engine: Engine, radius_m: FloatArray, face_m: float) -> FloatArray:
    """Let the last robot drive into the others for 10 s; the deepest overlap after each tick."""
    speed_mps = np.zeros(len(radius_m))
    speed_mps[-1] = 0.3
    overlaps: list[float] = []
    for _ in range(100):
        engine.tick(targets(engine, speed_mps))
        in_face_m = float((engine.state[0, :, 0] + radius_m).max()) - face_m
        overlaps.append(max(overlap_m(engine, radius_m), in_face_m))
    return np.array(overlaps)


@pytest.mark.parametrize("rows", [1, -1], ids=["light-first", "heavy-first"])
@pytest.mark.parametrize("standing", STANDING)
@pytest.mark.parametrize("names", LINES, ids="-".join)
@pytest.mark.parametrize("make", FLOOR)
def test_robots_pressed_against_an_obstacle_rest_without_overlap(
    make: Make, names: list[str], standing: str, rows: int
) -> None:
    obstacles, face_m = STANDING[standing]
    order = np.arange(len(names))[::rows]
    radius_m = np.array([load_body(name).radius_m for name in names])
    engine, row_radius_m = engine_of(
        make, [names[k] for k in order], line_poses(names, face_m)[order], size_m=SIZE_M, obstacles=obstacles
    )
    speed_mps = np.where(order == len(names) - 1, 0.3, 0.0)
    for _ in range(100):
        engine.tick(targets(engine, speed_mps))
    # Rigid discs: each stands where those before it end.
    x_m = face_m - 2.0 * np.cumsum(radius_m) + radius_m
    assert engine.state[0, :, 0] == pytest.approx(x_m[order], abs=MAX_OVERLAP_M)
    assert overlap_m(engine, row_radius_m, SIZE_M) <= MAX_OVERLAP_M
    assert np.abs(engine.state[0, :, 3:5]).max() < 0.02
    # The wheels stood soon after the run-up: 0.1 m, and 0.1 m more at most.
    assert engine.travel_m[0, order.argmax()].max() < 0.2


@pytest.mark.parametrize("standing", STANDING)
@pytest.mark.parametrize("names", LINES, ids="-".join)
def test_discs_never_pass_through_what_they_press(names: list[str], standing: str) -> None:
    obstacles, face_m = STANDING[standing]
    engine, radius_m = engine_of(DiscsEngine, names, line_poses(names, face_m), size_m=SIZE_M, obstacles=obstacles)
    assert press(engine, radius_m, face_m).max() <= MAX_OVERLAP_M


@pytest.mark.parametrize("names", LINES, ids="-".join)
def test_pymunk_overlaps_on_the_way_by_less_than_the_smallest_radius(names: list[str]) -> None:
    """The stated limit: bodies overlap for a while before they rest, but none changes sides."""
    engine, radius_m = engine_of(PymunkEngine, names, line_poses(names, 1.5), size_m=SIZE_M)
    assert press(engine, radius_m, 1.5).max() < radius_m.min()


@pytest.mark.parametrize("mass_kg", [0.01, 0.1, 0.5])
@pytest.mark.parametrize("shape", [{"shape": "cylinder", "radius_m": 0.1}, {"shape": "box", "size_m": (0.2, 0.2)}])
def test_load_pressed_against_a_wall_rests_without_overlap(shape: dict[str, Any], mass_kg: float) -> None:
    load = Obstacle(x_m=1.2, y_m=0.0, mass_kg=mass_kg, **shape)
    engine, radius_m = engine_of(PymunkEngine, ["footbot"], [[0.9, 0.0, 0.0]], size_m=SIZE_M, obstacles=[load])
    assert isinstance(engine, PymunkEngine)
    for _ in range(60):
        engine.tick(targets(engine, 0.3))
    assert engine.movable[0, 0, 0] == pytest.approx(1.4, abs=MAX_OVERLAP_M)
    assert engine.state[0, 0, 0] == pytest.approx(1.3 - radius_m[0], abs=MAX_OVERLAP_M)


def in_boxes_m(xy: FloatArray, radius_m: FloatArray, boxes: Sequence[Obstacle]) -> float:
    """The deepest overlap of discs with boxes, by the distance to a rectangle; inside one, to its nearest side."""
    deepest = -np.inf
    for box in boxes:
        cos, sin = np.cos(box.heading_rad), np.sin(box.heading_rad)
        inside = np.abs((xy - [box.x_m, box.y_m]) @ np.array([[cos, -sin], [sin, cos]])) - 0.5 * np.array(box.size_m)
        distance_m = np.where((inside < 0.0).all(1), inside.max(1), np.hypot(*np.maximum(inside, 0.0).T))
        deepest = max(deepest, float((radius_m - distance_m).max()))
    return deepest


@pytest.mark.parametrize("still", [False, True], ids=["light-ones-drive", "light-ones-stand"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_mixed_crowd_of_discs_in_a_shrinking_gap_never_overlaps(seed: int, still: bool) -> None:
    """Kilobots go first, TurtleBots and foot-bots press from behind, into a funnel that ends in a corner."""
    rng = np.random.default_rng(seed)
    crowd = ["kilobot"] * 12 + ["epuck"] * 8 + ["footbot", "turtlebot4"] * 10
    rank = rng.normal(0.0, 0.5, 40) + np.repeat([0.0, 1.0, 2.0], [12, 8, 20])
    names = [crowd[k] for k in np.argsort(rank)]
    column, row = np.divmod(np.arange(40), 5)
    pose = np.column_stack([0.05 - 0.4 * column, 0.4 * (row - 2.0), np.zeros(40)])
    funnel = [Obstacle("box", 1.5, y_m, turn, size_m=(3.0, 0.2)) for y_m, turn in ((0.95, -0.45), (-0.95, 0.45))]
    engine, radius_m = engine_of(DiscsEngine, names, pose, size_m=(6.0, 4.0), obstacles=funnel)
    speed_mps = np.array([load_body(name).max_linear_mps for name in names])
    if still:
        speed_mps[radius_m < 0.02] = 0.0
    for _ in range(200):
        engine.tick(targets(engine, speed_mps, towards(engine, 2.9, 0.0)))
        assert overlap_m(engine, radius_m, (6.0, 4.0)) <= MAX_OVERLAP_M
        assert in_boxes_m(engine.state[0, :, :2], radius_m, funnel) <= MAX_OVERLAP_M


@pytest.mark.parametrize("make", FLOOR)
def test_pressing_is_bit_for_bit_equal_alone_and_among_arenas(make: Make) -> None:
    names = ["kilobot", "kilobot", "footbot"]
    pressed = line_poses(names, 1.5)
    free, aside = pressed - np.array([1.0, 0.0, 0.0]), pressed + np.array([0.0, 0.9, 0.0])
    ends: list[FloatArray] = []
    for pose in ([free, pressed, aside], [pressed]):
        engine, _ = engine_of(make, names, np.array(pose), size_m=SIZE_M)
        for _ in range(40):
            engine.tick(targets(engine, [0.0, 0.0, 0.3]))
        ends.append(engine.state[1 if len(pose) == 3 else 0])
    assert np.array_equal(*ends)

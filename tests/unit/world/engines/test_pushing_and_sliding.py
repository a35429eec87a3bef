"""Both engines of the floor agree in the results of pushing and of sliding."""

import pytest

from tests.support.world.engines.conformance import FLOOR, R, asked, made


@pytest.mark.parametrize("aside_m", [0.0, 0.02, 0.05])
def test_a_robot_pushes_a_dead_one_as_far(aside_m: float) -> None:
    ends: list[list[float]] = []
    for make in FLOOR:
        engine = made(make, [[0.0, aside_m, 0.0], [2.0 * R + 0.05, 0.0, 1.0]], (6.0, 4.0))
        engine.braked[0, 1] = True
        for _ in range(100):
            engine.tick(asked(engine, [0.2, 0.0]))
        ends.append(engine.state[0, :, :2].ravel().tolist())
    assert ends[0] == pytest.approx(ends[1], abs=0.02)
    assert ends[0][2] > 2.0 * R + 0.2


@pytest.mark.parametrize("heading", [0.2, 0.5, 0.9, 1.2])
def test_a_robot_slides_along_a_wall_as_far(heading: float) -> None:
    ends: list[list[float]] = []
    for make in FLOOR:
        engine = made(make, [[0.0, 1.7, heading]], (6.0, 4.0))
        for _ in range(60):
            engine.tick(asked(engine, 0.2))
        ends.append([*engine.state[0, 0, :3].tolist(), *engine.travel_m[0, 0].tolist()])
    assert ends[0] == pytest.approx(ends[1], abs=0.01)

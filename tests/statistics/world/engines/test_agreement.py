"""The floor engines agree in what crowds do on average, though not in single paths."""

from typing import Any

import numpy as np
import pytest

from swarmwire.comms.draws import purpose, uniform
from swarmwire.world.world import World
from tests.support.world.pairs import assert_same_on_average
from tests.support.world.samples import commanded, posed

TURN = purpose("turns of blind walkers")
OBSTACLES = [
    {"shape": "cylinder", "radius_m": 0.15, "place": "random", "count": 3},
    {"shape": "box", "size_m": [0.4, 0.1], "place": "random", "count": 3},
    {"shape": "polygon", "points": [[0, 0], [0.3, 0], [0, 0.3]], "place": "random", "count": 2},
]
CROWDS: dict[str, dict[str, Any]] = {
    "alike": {"a": {"body": "epuck", "count": 60, "agent": "x"}},
    "mixed": {"a": {"body": "epuck", "count": 30, "agent": "x"}, "b": {"body": "footbot", "count": 12, "agent": "x"}},
}
TICKS = 400
MARGIN = 0.03  # with enough seeds one sees that pymunk's robots lose touch with walls 2 % more often


def walked(engine: str, crowd: str, arenas: int) -> dict[str, np.ndarray]:
    """What blind walkers in a room of 2 m with obstacles come to in each arena, a number per arena each."""
    arena = {"size_m": [2.0, 2.0], "obstacles": OBSTACLES}
    scenario = posed([], arena=arena, robots=CROWDS[crowd], physics={"engine": engine})
    world = World(scenario, range(arenas), {})
    assert world.engines == (engine,)
    robots, start = world.static.robots, world.pose[:, :2].copy()
    index, touched, speed = np.arange(robots), np.zeros(arenas), np.zeros(arenas)
    onsets = np.zeros((arenas, 2))
    asked, heading = np.zeros((arenas, robots)), world._physics.state[:, :, 2].copy()
    for tick in range(TICKS):
        # Each turns at random for a second, in every third second.
        turn = 4.0 * uniform(world.keys[:, None], index, tick // 10, 0, TURN) - 2.0
        turn = np.where((index + tick // 10) % 3 == 0, turn, 0.0)
        onsets += world.move(commanded(world, 0.1, turn.ravel()))
        speed += np.hypot(*world.velocity[:, :2].T).reshape(arenas, -1).mean(axis=1)
        asked += 0.1 * turn
        touched += world._physics.touched.mean(axis=1)
    away = np.hypot(*(world.pose[:, :2] - start).T).reshape(arenas, -1).mean(axis=1)
    rolled = world._physics.travel_m.mean(axis=(1, 2))
    return {
        "robot contacts": onsets[:, 0],
        "wall contacts": onsets[:, 1],
        "touching": touched / TICKS,
        "speed": speed / TICKS,
        "turned by others": np.abs(world._physics.state[:, :, 2] - heading - asked).mean(axis=1),
        "away from the start": away,
        "rolled": rolled,
    }


def compare(crowd: str, arenas: int) -> None:
    discs, pymunk = (walked(engine, crowd, arenas) for engine in ("discs", "pymunk"))
    for name, ours in discs.items():
        assert_same_on_average(f"{crowd}, {name}", ours, pymunk[name], MARGIN)


@pytest.mark.parametrize("crowd", list(CROWDS))
def test_crowds_do_the_same_on_average(crowd: str) -> None:
    compare(crowd, 10)


@pytest.mark.slow
@pytest.mark.parametrize("crowd", list(CROWDS))
def test_crowds_do_the_same_on_average_over_many_seeds(crowd: str) -> None:
    compare(crowd, 40)

import numpy as np
import pytest

from swarmwire.comms.truth import Light
from swarmwire.metrics.metrics import Metrics
from swarmwire.metrics.task.find_time import FindTime
from tests.support.metrics.truths import static, truth

LIGHTS = [[Light(2.0, 0.0, 1.0), Light(-3.0, 0.0, 1.0)], [Light(0.0, 0.0, 1.0)], []]


def found(x_m, alive=None, within_m=0.5, lights=LIGHTS, share=0.0, robots=2):
    """The metric in each tick, of robots at x (ticks, rows) in arenas of so many."""
    of = static(robots, arenas=len(x_m[0]) // robots, lights=lights)
    metrics, told = Metrics([FindTime(within_m=within_m, share=share)]), []
    metrics.begin(of)
    for tick, at in enumerate(x_m):
        pose = np.zeros((len(at), 3))
        pose[:, 0] = at
        living = np.ones(len(at), np.bool_) if alive is None else np.array(alive[tick])
        metrics.see(truth(of, tick, pose=pose, alive=living))
        told.append(metrics.latest["find_time_s"].tolist())
    return told, metrics.end(None)["metrics"]


def test_it_is_when_the_first_robot_came_near_a_light_and_stays():
    told, summary = found(
        [[0, 0, 4, 1, 0, 0], [1, 1.5, 4, 4, 0, 0], [1, 0, 0.51, 4, 0, 0], [2, -3, 0.49, 4, 0, 0]],
    )
    nan = np.nan
    expected = [[nan, nan, nan], [0.1, nan, nan], [0.1, nan, nan], [0.1, 0.3, nan]]
    np.testing.assert_allclose(told, expected)
    assert [arena["find_time_s"]["final"] for arena in summary] == [0.1, 0.3, None]


def test_who_starts_there_has_found_it_at_once():
    assert found([[2.5, 0, 0, 0]], lights=LIGHTS[:2])[0] == [[0.0, 0.0]]


def test_the_dead_find_nothing_and_what_was_found_stays_found():
    alive = [[False, True], [True, True], [False, False]]
    told, _ = found([[2, 0], [2, 0], [0, 0]], alive, lights=LIGHTS[:1])
    assert told == [[pytest.approx(np.nan, nan_ok=True)], [0.1], [0.1]]


def test_the_distance_is_a_parameter():
    assert found([[0.9, 0], [1.0, 0]], within_m=1.0, lights=LIGHTS[:1])[0] == [
        [pytest.approx(np.nan, nan_ok=True)],
        [0.1],
    ]


def test_without_lights_nothing_is_found():
    assert np.isnan(found([[0, 0]], lights=[])[0]).all()


def test_of_a_share_of_the_robots_alive_as_many_must_be_there_at_once():
    x_m = [[2, 0, 0, 0, 0], [0, 2, 2, 0, 0], [2, 2, 2, 0, 0]]
    ticks = [found(x_m, lights=LIGHTS[:1], share=share, robots=5)[0] for share in (0.2, 0.4, 0.6)]
    assert [told[-1] for told in ticks] == [[0.0], [0.1], [0.2]]
    three_alive = [[True, True, False, True, False]] * 3
    assert found(x_m, three_alive, lights=LIGHTS[:1], share=0.6, robots=5)[0][-1] == [0.2]

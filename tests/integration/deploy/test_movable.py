"""A pushed obstacle is seen where it is: by the radio, the record, pictures, the viewer, and in every layout."""

from pathlib import Path

import numpy as np
import pytest

from swarmwire.deploy import Recording, Simulation, run
from swarmwire.metrics.drawing.film import film_of
from swarmwire.metrics.run_folder.reader import RunFolder
from tests.support.deploy.layouts import run_spread

PUSHER = """
from swarmwire.agent import Agent

class Pusher(Agent):
    needs = ("compass",)

    def step(self, robot):
        if abs(robot.compass.heading_rad) < 0.1:
            robot.drive(0.1, 0.0)
"""
SCENARIO = """
format = 1
name = "a box between two"
duration_s = 12.0

[arena]
size_m = [4.0, 4.0]
obstacles = [
    { shape = "cylinder", radius_m = 0.1, at = [-1.5, 1.5] },
    { shape = "box", size_m = [0.1, 0.4], at = [0.0, 0.0], movable = true, mass_kg = 0.05 },
]

[robots.a]
body = "epuck"
count = 3
agent = "pusher.py:Pusher"
place = { how = "poses", poses = [[-0.4, 0.0, 0.0], [0.3, 1.0, 1.5], [0.3, -1.0, 1.5]] }

[radio]
range_m = 2.5
"""
BETWEEN = [1, 2]  # the robots between which the box is pushed


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    (tmp_path / "pusher.py").write_text(PUSHER)
    (tmp_path / "box.toml").write_text(SCENARIO)
    return tmp_path / "box.toml"


def test_a_box_that_is_pushed_between_two_robots_blocks_their_radio(scenario: Path) -> None:
    with Simulation(scenario) as simulation:
        truths = [simulation.step() for _ in range(simulation.ticks)]
    passed = 0
    for truth in truths:
        assert truth.movable is not None
        assert truth.edges is not None
        [(x, _, _)] = truth.movable[0].tolist()
        passed += abs(x - 0.3) < 0.03
        joined = BETWEEN in np.sort(truth.edges, axis=1).tolist()
        if abs(x - 0.3) < 0.03:
            assert not joined
        if x < 0.2:
            assert joined
    assert passed > 5


def test_the_record_and_its_pictures_show_it_where_it_is(scenario: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    result = run(scenario, out=out, record=Recording(rrd=False))
    assert result.engine == "pymunk"
    folder = RunFolder(out)
    film = film_of(folder, 0, "")
    assert film.movable is not None
    assert film.movable.shape == (120, 1, 3)
    assert film.movable[0, 0].tolist() == [0.0, 0.0, 0.0]
    [box] = film.movable_at(119)
    assert (box.shape, box.size_m) == ("box", (0.1, 0.4))
    assert box.x_m > 0.2
    assert "movable_x_m" not in folder.metrics().columns
    pytest.importorskip("matplotlib", reason="needs the extra [report]")
    from swarmwire.metrics.drawing.animation import FilmFigure
    from tests.integration.metrics.drawing.test_animation import FLOOR, MOVABLE, color_at

    figure = FilmFigure(film, 640)
    side_m = 0.15  # along the box from its middle: there the pusher does not hide it
    c, s = np.cos(box.heading_rad), np.sin(box.heading_rad)
    places = (0.0, side_m), (box.x_m - s * side_m, box.y_m + c * side_m)
    for index, colors in ((0, [MOVABLE, FLOOR]), (119, [FLOOR, MOVABLE])):
        image = figure.frame(index).copy()
        assert [color_at(figure, image, *place) for place in places] == colors


def test_runs_with_movable_obstacles_are_the_same_in_every_layout(scenario: Path) -> None:
    alone = run(scenario, seeds=[7])
    assert alone.ended == "duration"
    assert run_spread(scenario, 2, seeds=[7]).trajectory_sha256 == alone.trajectory_sha256
    assert run(scenario, seeds=[5, 7]).trajectory_sha256[1:] == alone.trajectory_sha256

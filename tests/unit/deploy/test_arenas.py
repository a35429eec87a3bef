"""Arenas end to end: from a picture, with a painted floor, on a torus; each runs, is recorded, drawn and repeated."""

import hashlib
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy import RunFolder, Simulation, repeat, run
from swarmwire.metrics.run_folder.tables import read_static
from tests.support.deploy.runs import ROOT

MAZE = ROOT / "scenarios" / "maze.toml"
ROUND = """
format = 1
name = "round the world"
duration_s = 30

[arena]
size_m = [2.0, 1.5]
boundary = "torus"
obstacles = [{ shape = "cylinder", radius_m = 0.1, count = 2, place = "random" }]
ground.patches = [{ shape = "disc", at = [1.0, 0.75], radius_m = 0.2, shade = 0 }]

[physics]
engine = "kinematic"

[robots.flock]
body = "epuck"
count = 12
place = { how = "arena", apart_m = 0.05 }
agent = "swarmwire.agent.behaviours:Flocking"
params = { separation_m = 0.2 }

[radio]
range_m = 0.6
line_of_sight = true
measures = { range = {}, bearing = {} }
"""


@pytest.fixture
def around(tmp_path: Path) -> Path:
    path = tmp_path / "round.toml"
    path.write_text(ROUND)
    return path


def test_a_run_in_a_maze_is_repeated_from_its_folder_alone(tmp_path: Path):
    there = tmp_path / "there"
    there.mkdir()
    for name in ("maze.toml", "maze.pgm"):
        shutil.copy(MAZE.parent / name, there)
    shutil.copy(there / "maze.pgm", there / "floor.pgm")
    floor = ["duration_s=2", "arena.ground.image='floor.pgm'"]
    result = run(there / "maze.toml", overrides=floor, seeds=[3, 4], out=tmp_path / "run")
    shutil.rmtree(there)
    copies = {file["path"]: file for file in json.loads((tmp_path / "run" / "run.json").read_text())["files"]}
    digest = hashlib.sha256((MAZE.parent / "maze.pgm").read_bytes()).hexdigest()
    assert copies["files/maze.pgm"] == {"path": "files/maze.pgm", "sha256": digest, "what": "map"}
    assert copies["files/floor.pgm"] == {"path": "files/floor.pgm", "sha256": digest, "what": "ground"}
    repetition = repeat((tmp_path / "run").rename(tmp_path / "moved"))
    assert (repetition.same, repetition.changes) == (True, ())
    assert repetition.before == tuple(result.trajectory_sha256)
    picture = tmp_path / "moved" / "files" / "maze.pgm"
    picture.write_text(picture.read_text().replace("0 1 1 1 1 1 1 1 1 1 1 1 1 1", "0 0 1 1 1 1 1 1 1 1 1 1 1 1", 1))
    repetition = repeat(tmp_path / "moved")
    assert repetition.changes == ("files/maze.pgm is not as the run left it: its sha256 differs",)


def test_the_record_of_a_run_holds_heights_boundary_and_floor(tmp_path: Path):
    with Simulation(MAZE, overrides=["duration_s=0.2"], out=tmp_path / "run") as simulation:
        simulation.run()
        static = simulation.static
    assert read_static(tmp_path / "run" / "static.json") == static
    assert {obstacle.height_m for obstacle in static.obstacles[0]} == {0.2}
    assert static.floor is not None


def test_robots_go_round_a_torus_and_are_received_across_its_seam(tmp_path: Path, around: Path):
    result = run(around, out=tmp_path / "run")
    assert result.radio is not None
    assert (result.radio.link_pdr or 0.0) > 0.99
    ticks = RunFolder(tmp_path / "run").robots()
    xy = ticks.select("x_m", "y_m").to_numpy().reshape(-1, 12, 2)
    assert np.all(np.abs(xy) <= [1.0 + 1e-6, 0.75 + 1e-6])
    jumps = np.abs(np.diff(xy, axis=0)) > 0.5
    assert jumps.any()
    assert (result.metrics["min_gap"].min or 0.0) < 0.2


def test_arenas_on_a_torus_run_as_they_do_alone(around: Path):
    both = run(around, overrides=["duration_s=5"], seeds=[1, 2])
    alone = [run(around, overrides=["duration_s=5"], seed=seed).trajectory_sha256[0] for seed in (1, 2)]
    assert list(both.trajectory_sha256) == alone
    assert alone[0] != alone[1]


@pytest.mark.parametrize(
    ("setting", "key"),
    [
        ("physics.engine='auto'", "arena.boundary"),
        ("radio={model='friis'}", "radio.model"),
        ("radio.bodies_block=true", "radio.bodies_block"),
    ],
)
def test_what_a_torus_cannot_have_is_refused_at_the_door(around: Path, setting: str, key: str):
    with pytest.raises(BadInput) as caught:
        Simulation(around, overrides=[setting])
    assert caught.value.key == key

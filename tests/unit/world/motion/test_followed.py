"""Robots of a scenario that a source moves."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from swarmwire.comms.robot.tick_io import Actions, SparseTable
from swarmwire.world.scenario_file import scenario_from
from swarmwire.world.world import World
from tests.support.refusals import refused_input

STILL = Actions.joined([])
CSV = """t_s,robot,x_m,y_m,z_m,heading_rad
0,a,1,0,2,0
1,a,2,0,3,1
0,b,-1,-1,0,3
1,b,-1,-1,0,-3
"""


def mapping(motion: object, count: int = 2, **tables: object) -> dict[str, Any]:
    group = {"body": "epuck", "count": count, "agent": "swarmwire.agent.behaviours:Consensus", "motion": motion}
    return {
        "format": 1,
        "name": "followed",
        "duration_s": 1.0,
        "arena": {"size_m": [10.0, 10.0]},
        "robots": {"led": group},
        **tables,
    }


def traced(folder: Path, text: str = CSV, **settings: object) -> dict[str, Any]:
    (folder / "motion.csv").write_text(text)
    return {"source": "trace", "file": str(folder / "motion.csv"), **settings}


def world_of(table: dict[str, Any], seeds: tuple[int, ...] = (1,)) -> World:
    return World(scenario_from(table, "test"), seeds, {})


def test_trace_moves_robots_from_sample_to_sample_in_all_arenas(tmp_path: Path) -> None:
    world = world_of(mapping(traced(tmp_path)), (1, 2))
    assert world.pose[[0, 1, 2, 3]].tolist() == [[1.0, 0.0, 0.0], [-1.0, -1.0, 3.0]] * 2
    assert world.radio_pose[:, 3].tolist() == [2.0, 0.0] * 2
    for _ in range(5):
        world.move(STILL)
    assert world.pose[[0, 2]] == pytest.approx(np.array([[1.5, 0.0, 0.5]] * 2))
    assert world.velocity[0] == pytest.approx([1.0, 0.0, 1.0])
    assert abs(world.pose[1, 2]) == pytest.approx(np.pi, abs=1e-9)  # the short way from 3 to -3 rad
    assert world.velocity[1, 2] == pytest.approx(2.0 * np.pi - 6.0)
    assert world.radio_pose[:, 3] == pytest.approx([2.5, 0.0] * 2)
    for _ in range(20):
        world.move(STILL)
    assert world.pose[0] == pytest.approx([2.0, 0.0, 1.0])
    assert world.velocity[0].tolist() == [0.0, 0.0, 0.0]


def test_trace_begins_at_its_start_with_its_offset_and_chosen_robots(tmp_path: Path) -> None:
    world = world_of(mapping(traced(tmp_path, start_s=0.5, offset_m=[0.5, -1.0], robots=["b", "a"])))
    assert world.pose[1] == pytest.approx([2.0, -1.0, 0.5])
    assert world.pose[0, :2] == pytest.approx([-0.5, -2.0])


def test_commands_to_followed_robots_are_ignored_and_counted(tmp_path: Path) -> None:
    world = world_of(mapping(traced(tmp_path)))
    rows = np.arange(2)
    drive = Actions(rows, np.ones(2, np.bool_), np.full(2, 0.1), np.zeros(2), np.zeros(2))
    world.move(drive)
    assert world.counts()["commands_to_followed"].tolist() == [2]
    assert not world.command.any()


@pytest.mark.parametrize(
    ("motion", "tables", "key"),
    [
        ({"file": "missing.csv"}, {}, "robots.led.motion.file"),
        ({"robots": ["a", "c"]}, {}, "robots.led.motion.robots"),
        ({"robots": ["a"]}, {}, "robots.led.motion"),
        ({}, {"count": 1}, "robots.led.motion"),
        ({}, {"arena": {"size_m": [10.0, 10.0], "boundary": "torus"}}, "robots.led.motion"),
        # An origin is for EMANE alone, and always, whatever the case of the suffix.
        *(({"file": file}, {}, "robots.led.motion.origin") for file in ("a.EEL", "a.eel")),
        ({"file": "a.CSV", "origin": [0.0, 0.0, 0.0]}, {}, "robots.led.motion.origin"),
        ({"offset_m": [4.5, 0.0]}, {}, "robot a"),
    ],
)
def test_trace_that_does_not_fit_names_key_or_robot(tmp_path: Path, motion: dict[str, Any], tables: Any, key: str):
    with refused_input(key=key):
        world_of(mapping({**traced(tmp_path), **motion}, **tables))


def moved_to(world: World, row: int, *values: float) -> None:
    """A tick at whose end a robot has this new pose: x, y, z in m, heading in rad, or the first of these."""
    slots = len(values)
    world.move(replace(STILL, poses=SparseTable(np.full(slots, row), np.arange(slots), np.array(values))))


def test_live_robot_stands_where_it_was_placed_until_its_first_pose() -> None:
    table = mapping({"source": "udp"})
    table["robots"]["led"]["place"] = {"how": "poses", "poses": [[0.0, 1.0, 0.5], [2.0, 1.0, 0.0]]}
    world = world_of(table)
    world.move(STILL)
    assert world.pose[:, :2].tolist() == [[0.0, 1.0], [2.0, 1.0]]
    moved_to(world, 0, -1.0, 1.0)
    assert world.pose[0].tolist() == [-1.0, 1.0, 0.5]  # without a heading it keeps that of its place
    moved_to(world, 1, -3.0, 2.0, 1.5, 1.0)
    assert world.pose[1].tolist() == [-3.0, 2.0, 1.0]
    assert world.velocity[1].tolist() == [0.0, 0.0, 0.0]  # set there, not moved there
    assert world.radio_pose[:, 3].tolist() == [0.0, 1.5]
    moved_to(world, 1, -2.9, 2.0)
    assert world.velocity[1] == pytest.approx([1.0, 0.0, 0.0])
    world.move(STILL)
    assert world.pose[1] == pytest.approx([-2.9, 2.0, 1.0])
    assert world.velocity[1].tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("engine", ["kinematic", "discs", "pymunk"])
def test_live_robot_is_at_its_first_pose_before_the_first_tick(engine: str) -> None:
    free = {"body": "epuck", "count": 1, "agent": "swarmwire.agent.behaviours:Diffusion"}
    table = mapping({"source": "udp"}, physics={"engine": engine})
    table["robots"]["led"]["place"] = {"how": "poses", "poses": [[0.0, 1.0, 0.5], [2.0, 1.0, 0.0]]}
    table["robots"]["free"] = {**free, "place": {"how": "poses", "poses": [[-2.9, 2.06, 0.0]]}}
    world = world_of(table)
    world.set_first_poses(SparseTable(np.array([1, 1, 1, 2]), np.array([0, 1, 2, 0]), np.array([-3.0, 2.0, 0.5, 4.0])))
    assert world.radio_pose[:2].tolist() == [[0.0, 1.0, 0.5, 0.0], [-3.0, 2.0, 0.0, 0.5]]
    assert world.pose[2].tolist() == [-2.9, 2.06, 0.0]  # no source moves it
    assert not world.velocity.any()
    onsets = world.move(replace(STILL, poses=SparseTable(np.array([1]), np.array([0]), np.array([-2.9]))))
    assert world.velocity[1] == pytest.approx([1.0, 0.0, 0.0])  # 0.1 m in a tick of 0.1 s
    assert onsets[0, 0] == 1  # with the free robot, then 6 cm away: both have a radius of 3.5 cm
    assert world.pose[1] == pytest.approx([-2.9, 2.0, 0.0])


ORBIT = """
from dataclasses import dataclass
import numpy as np
from swarmwire.world.motion.source import PoseSource

@dataclass
class Orbit(PoseSource):
    count: int
    speed_mps: float
    rows: int = 0

    def at(self, time_s):
        x = self.speed_mps * time_s + np.arange(self.count)
        return np.stack([x, 0 * x, 0 * x, 0 * x], axis=1)[self.rows:]
"""


def test_custom_source_moves_robots_and_its_faults_name_the_key(tmp_path: Path) -> None:
    (tmp_path / "orbit.py").write_text(ORBIT)
    motion = {"source": "custom", "kind": f"{tmp_path / 'orbit.py'}:Orbit", "params": {"speed_mps": 0.5}}
    world = world_of(mapping(motion))
    for _ in range(10):
        world.move(STILL)
    assert world.pose[:, 0] == pytest.approx([0.5, 1.5])
    for params, key in (({}, ".params"), ({"speed_mps": float("nan")}, ""), ({"speed_mps": 1.0, "rows": 1}, "")):
        with refused_input(key=f"robots.led.motion{key}"):
            world_of(mapping({**motion, "params": params}))


def test_followed_group_beside_robots_that_drive_shares_their_engine(tmp_path: Path) -> None:
    table = mapping(traced(tmp_path))
    assert world_of(table).engines == ("kinematic",)
    robots = {**table["robots"], "free": {"body": "epuck", "count": 1, "agent": "swarmwire.agent.behaviours:Diffusion"}}
    assert world_of({**table, "robots": robots}).engines == ("discs",)

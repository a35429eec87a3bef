"""Folders of runs as traces; tests/integration/deploy/test_motion.py has folders that runs wrote."""

import json
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from swarmwire.world.motion.traces.reading import files_of, read_trace
from swarmwire.world.motion.traces.trace import TracePoses
from tests.support.refusals import refused_input

RATE_HZ = 30
STATIC: dict[str, Any] = {
    "format": 1,
    "rate_hz": RATE_HZ,
    "robot_names": ["low-0", "high-0"],
    "groups": [
        {"start": 0, "stop": 1, "body": {"altitude_m": 0.0}},
        {"start": 1, "stop": 2, "body": {"altitude_m": 5.0}},
    ],
}


def recorded(folder: Path, static: dict[str, Any] = STATIC, **columns: Any) -> Path:
    """Folder of a run of two arenas, whose robots are at the third part of the tick, plus 7 in the second one."""
    folder.mkdir()
    (folder / "static.json").write_text(json.dumps(static))
    tick, arena = np.repeat(np.arange(4), 2), np.tile([0, 1], 4)
    x_m = np.stack([tick / 3.0 + 7.0 * arena, -tick / 3.0], axis=1).astype(np.float32)
    frame = {"tick": tick, "arena": arena, "x_m": x_m, "y_m": 2.0 * x_m, "heading_rad": 0.1 * x_m, **columns}
    pl.DataFrame(frame).write_parquet(folder / "ticks.parquet")
    return folder


def test_run_folder_gives_the_recorded_poses_of_the_first_arena_bit_for_bit(tmp_path: Path) -> None:
    trace = read_trace(recorded(tmp_path / "run"))
    assert trace.names == ("low-0", "high-0")
    poses = TracePoses(trace, [1, 0], 0.0)
    for tick in range(4):
        third = float(np.float32(tick / 3.0))
        heading_rad = float(np.float32(0.1) * np.float32(tick / 3.0))
        expected = [[-third, -2.0 * third, 5.0, -heading_rad], [third, 2.0 * third, 0.0, heading_rad]]
        assert poses.at(tick / RATE_HZ).tolist() == expected


def test_run_folder_gives_recorded_heights(tmp_path: Path) -> None:
    z_m = np.tile(np.array([1.5, 2.5], np.float32), (8, 1))
    assert read_trace(recorded(tmp_path / "run", z_m=z_m)).z_m.tolist() == [1.5] * 4 + [2.5] * 4


def test_run_folder_of_a_killed_run_is_read_from_its_parts(tmp_path: Path) -> None:
    folder = recorded(tmp_path / "run")
    unbroken, ticks = read_trace(folder), pl.read_parquet(folder / "ticks.parquet")
    (folder / "ticks.parquet").unlink()
    (folder / "ticks").mkdir()
    for part in (0, 1):
        ticks[4 * part : 4 * part + 4].write_parquet(folder / "ticks" / f"part-00000{part}.parquet")
    assert [file.name for file in files_of(folder)] == ["static.json", "part-000000.parquet", "part-000001.parquet"]
    trace = read_trace(folder)
    assert (trace.t_s.tolist(), trace.x_m.tolist()) == (unbroken.t_s.tolist(), unbroken.x_m.tolist())


def test_folder_that_is_no_intact_run_is_refused(tmp_path: Path) -> None:
    with refused_input(tmp_path, "", "expected the folder of a run"):
        read_trace(tmp_path)
    folder = recorded(tmp_path / "newer", {**STATIC, "format": 2})
    with refused_input(folder / "static.json", "format", "newer"):
        read_trace(folder)
    folder = recorded(tmp_path / "third", {**STATIC, "robot_names": ["a", "b", "c"]})
    with refused_input(folder, "", "intact table"):
        read_trace(folder)
    folder = recorded(tmp_path / "nan", y_m=np.full((8, 2), nan, np.float32))
    with refused_input(folder, "y_m", "finite"):
        read_trace(folder)
    (folder / "ticks.parquet").write_bytes(b"PAR1")
    with refused_input(folder, "", "intact table"):
        read_trace(folder)
    (folder / "ticks.parquet").unlink()
    with refused_input(folder, "", "recorded its motion"):
        read_trace(folder)

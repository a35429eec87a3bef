"""What a scenario's files bring, end to end: arenas from a picture, on a torus, and measured links."""

import hashlib
import json
import shutil
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.robot.packets import Fate
from swarmwire.deploy import RunFolder, Simulation, repeat, run
from swarmwire.deploy.runs.scenario_parts import read_link_traces
from swarmwire.metrics.records.run_folder.tables import read_static
from swarmwire.world.scenario_file import load_scenario
from tests.support.deploy.runs import LOSSY, ROOT
from tests.support.refusals import refused_input

MAZE = ROOT / "scenarios" / "maze.toml"
WALLED = ROOT / "scenarios" / "flocking-802154.toml"
REPLAYED = ROOT / "scenarios" / "replayed-links.toml"
HEAD = "t_s,tx,rx,delivery_ratio"
PAIR = "flock-0,flock-1"
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


def without_a_wall(picture: str) -> str:
    return picture.replace("0 1 1 1 1 1 1 1 1 1 1 1 1 1", "0 0 1 1 1 1 1 1 1 1 1 1 1 1", 1)


@pytest.mark.parametrize(
    ("scenario", "files", "overrides", "change"),
    [
        (MAZE, {"map": "maze.pgm", "ground": "floor.pgm"}, ["arena.ground.image='floor.pgm'"], without_a_wall),
        (REPLAYED, {"trace": "replayed-links.csv"}, [], lambda _: f"{HEAD}\n0,{PAIR},1\n"),
    ],
)
def test_run_with_files_is_repeated_from_its_folder_alone(tmp_path: Path, scenario, files, overrides, change):
    source, folder = tmp_path / "there", tmp_path / "run"
    source.mkdir()
    shutil.copy(scenario, source)
    first, *_ = files.values()
    original = (scenario.parent / first).read_bytes()
    for name in files.values():
        (source / name).write_bytes(original)
    result = run(source / scenario.name, overrides=["duration_s=2", *overrides], seeds=[3, 4], out=folder)
    shutil.rmtree(source)
    copies = {copied["what"]: copied for copied in json.loads((folder / "run.json").read_text())["files"]}
    digest = hashlib.sha256(original).hexdigest()
    for key, name in files.items():
        assert copies[key] == {"path": f"files/{name}", "sha256": digest, "what": key}
    moved = folder.rename(tmp_path / "moved")
    repetition = repeat(moved)
    assert (repetition.same, repetition.changes) == (True, ())
    assert repetition.before == tuple(result.trajectory_sha256)
    copy = moved / "files" / first
    copy.write_text(change(copy.read_text()))
    repetition = repeat(moved)
    assert repetition.changes == (f"files/{first} is not as the run left it: its sha256 differs",)
    assert scenario == MAZE or not repetition.same


def test_record_of_a_run_holds_heights_boundary_and_floor(tmp_path: Path):
    with Simulation(MAZE, overrides=["duration_s=0.2"], out=tmp_path / "run") as simulation:
        simulation.run()
        static = simulation.plan.static
    assert read_static(tmp_path / "run" / "static.json") == static
    assert {obstacle.height_m for obstacle in static.obstacles[0]} == {0.2}
    assert static.floor is not None


def test_robots_go_round_a_torus_and_are_received_across_its_seam(tmp_path: Path, around: Path):
    result = run(around, out=tmp_path / "run")
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
def test_torus_with_a_setting_it_cannot_have_is_refused(around: Path, setting: str, key: str):
    with refused_input(key=key):
        Simulation(around, overrides=[setting])


def test_shipped_links_are_cut_between_halves_when_the_file_says():
    """From 20 s to 40 s, between the first three and the last three."""
    across: dict[bool, list[bool]] = {False: [], True: []}
    beside: list[bool] = []
    with Simulation(REPLAYED) as simulation:
        while simulation.tick < 450:
            finished = simulation.step().finished
            is_across = (finished.sender < 3) != (finished.receiver < 3)
            during = (finished.on_air_at_ns >= 20 * NS_PER_S) & (finished.on_air_at_ns < 40 * NS_PER_S)
            is_received = finished.fate == Fate.RECEIVED
            for cut in (False, True):
                across[cut] += is_received[is_across & (during == cut)].tolist()
            beside += is_received[~is_across].tolist()
    assert not any(across[True])
    assert len(across[True]) == 200 * 18
    assert sum(across[False]) / len(across[False]) > 0.6
    assert sum(beside) / len(beside) > 0.85


def test_signals_have_the_strengths_of_the_file(tmp_path: Path):
    """Of one link; the others are out of range, although the robots stand side by side."""
    links = {"t_s": [0.0, 1.0], "tx": ["flock-1"] * 2, "rx": ["flock-4"] * 2, "rssi_dbm": [-70, -80]}
    pl.DataFrame(links).write_parquet(tmp_path / "links.parquet")
    shutil.copy(WALLED, tmp_path / "walled.toml")
    radio = ["radio.trace.file='links.parquet'", "radio.fading={distribution='rician', k=1e6}"]
    strengths: dict[bool, set[int]] = {False: set(), True: set()}
    with Simulation(tmp_path / "walled.toml", overrides=radio) as simulation:
        while simulation.tick < 25:
            finished = simulation.step().finished
            assert finished.rssi_dbm is not None
            assert set(zip(finished.sender.tolist(), finished.receiver.tolist(), strict=True)) <= {(1, 4)}
            for on_air_ns, rssi_dbm in zip(finished.on_air_at_ns, finished.rssi_dbm, strict=True):
                strengths[bool(on_air_ns >= NS_PER_S)].add(round(float(rssi_dbm)))
    assert strengths == {False: {-70}, True: {-80}}


def test_links_of_a_scenario_made_in_python_are_kept_with_the_run(tmp_path: Path):
    scenario = load_scenario(REPLAYED, ["duration_s=1"])
    renamed = scenario.model_copy(update={"name": "renamed"}).with_source(scenario.source)
    run(renamed, out=tmp_path / "run")
    assert repeat(tmp_path / "run").same


@pytest.mark.parametrize(
    ("text", "settings", "where", "key"),
    [
        (f"{HEAD}\n0,flock-0,flock-20,1\n", [], "links.csv", "row 1, rx"),
        ("t_s,tx,rx,rssi_dbm\n0,flock-0,flock-1,-70\n", [], "links.csv", "rssi_dbm"),
        (HEAD, ["radio.trace.file='nowhere.csv'"], "lossy.toml", "radio.trace.file"),
        (HEAD, ["radio.trace.others='all'"], "--set radio.trace.others='all'", "radio.trace.others"),
    ],
)
def test_links_that_cannot_be_replayed_are_refused_before_anything_runs(tmp_path: Path, text, settings, where, key):
    (tmp_path / "links.csv").write_text(text)
    shutil.copy(LOSSY, tmp_path / "lossy.toml")
    with refused_input(where if where.startswith("--set") else tmp_path / where, key):
        Simulation(tmp_path / "lossy.toml", overrides=["radio.trace.file='links.csv'", *settings])


ROBOTS = ("flock-0", "flock-1", "flock-2")


def test_csv_and_parquet_are_read_by_name(tmp_path):
    file = tmp_path / "trace.csv"
    file.write_text(f"{HEAD}\n0,flock-2,flock-0,0.25\n0.5,flock-2,flock-0,1\n")
    pl.read_csv(file).write_parquet(tmp_path / "trace.parquet")
    for path in (file, tmp_path / "trace.parquet"):
        traces = read_link_traces(path, ROBOTS)
        assert traces.rssi_dbm is traces.delay_s is None
        links = np.array([2, 2, 0]), np.array([0, 0, 2]), np.array([499_999_999, 500_000_000, 500_000_000])
        assert traces.delivery_ratio.values_at(*links) == pytest.approx([0.25, 1.0, np.nan], nan_ok=True)


def test_link_traces_have_the_values_of_their_rows_per_quantity(tmp_path):
    file = tmp_path / "trace.csv"
    file.write_text("t_s,tx,rx,delay_s,rssi_dbm\n0,flock-0,flock-1,0.5,\n1,flock-0,flock-1,,-60\n")
    traces = read_link_traces(file, ROBOTS)
    assert traces.delivery_ratio is None
    sender, receiver, at_ns = np.array([0, 0, 1]), np.array([1, 1, 0]), np.array([0, 10**9, 10**9])
    for trace, expected in ((traces.delay_s, [0.5, 0.5, np.nan]), (traces.rssi_dbm, [np.nan, -60.0, np.nan])):
        assert trace.values_at(sender, receiver, at_ns) == pytest.approx(expected, nan_ok=True)
    assert traces.has_values(sender, receiver, at_ns).tolist() == [True, True, False]


BOTH = "t_s,tx,rx,rssi_dbm,delay_s"


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("t_s,tx,delay_s\n0,flock-0,1\n", "rx"),
        (f"t_s,tx,rx\n0,{PAIR}\n", ""),
        (f"{BOTH}\n0,{PAIR},-50,\n1,{PAIR},,\n", "row 2, rssi_dbm or delay_s"),
        (f"{BOTH}\n0,{PAIR},-50,\n0,{PAIR},,0.1\n1,{PAIR},,-1\n", "row 3, delay_s"),
        (f"{HEAD}\n0,{PAIR},1\n0,flock-0,flock-9,1\n", "row 2, rx"),
        (f"{HEAD}\n0,{PAIR},1.5\n", "row 1, delivery_ratio"),
        (f"{HEAD}\n0,{PAIR},\n", "row 1, delivery_ratio"),
        (f"{HEAD}\n,{PAIR},1\n", "row 1, t_s"),
        (f"{HEAD}\n1,{PAIR},1\n0,{PAIR},1\n", "row 2, t_s"),
    ],
)
def test_link_trace_fault_is_refused_by_row_and_column(tmp_path, text, key):
    file = tmp_path / "trace.csv"
    file.write_text(text)
    with refused_input(file, key):
        read_link_traces(file, ROBOTS)

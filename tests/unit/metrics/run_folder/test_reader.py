"""A run folder is read back: its tables, its static part, and the layout of its metrics."""

import json
from dataclasses import asdict, replace
from math import inf

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.geometry.floor import Floor, Patch, packed_image
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.observe.truth import EventRecord, Group, Light, Static
from swarmwire.comms.robot.bodies.body import body_from, body_names, load_body
from swarmwire.metrics.measures.metric import MetricInfo, metric_info
from swarmwire.metrics.measures.registry import METRICS, standard_names
from swarmwire.metrics.pictures.drawing.metrics_strip import is_count, limits, titled
from swarmwire.metrics.records.run_folder import reader, tables, ticks, writer
from swarmwire.metrics.records.run_folder.reader import SUMMARY_KINDS, RunFolder
from swarmwire.metrics.records.run_folder.table import TableState
from swarmwire.metrics.records.run_folder.tables import TABLES, read_static, write_static
from swarmwire.metrics.records.run_folder.verify import verify
from tests.support.metrics.recorded import links, made_up_summary, record, wandering
from tests.support.metrics.truths import static
from tests.support.refusals import refused_input

TICKS = 11


@pytest.fixture(params=["ended", "killed"])
def recorded(request, tmp_path, monkeypatch):
    """A folder as a run leaves it that ended, or that was killed just before: parts, and no summary."""
    if request.param == "killed":
        monkeypatch.setattr(writer, "join_parts", lambda *_: None)
    monkeypatch.setattr(ticks, "MAX_TICKS", 4)
    run, kill = static(3, arenas=2), EventRecord(0, 0.0, "kill", False, np.array([False, True, False] * 2))
    truths = list(wandering(run, TICKS, events=(kill,), finished=links([0, 1], [2, 0], [5, 6], 0, arena=[0, 1])))
    record(tmp_path, run, truths, packets=1.0)
    assert (tmp_path / "ticks").is_dir() == (request.param == "killed")
    return RunFolder(tmp_path), run, truths


def test_tables_are_read_of_all_arenas_or_of_one(recorded):
    folder, run, _ = recorded
    assert folder.ticks()["tick"].to_list() == [tick for tick in range(TICKS) for _ in range(2)]
    for arena in range(2):
        assert folder.ticks(arena)["seed"].to_list() == [run.seeds[arena]] * TICKS
        assert folder.packets(arena)["sender"].to_list() == [arena] * TICKS
        assert folder.events(arena)["robots"].to_list() == [["flock-1"]] * TICKS
    assert (len(folder.packets()), len(folder.events())) == (2 * TICKS, 2 * TICKS)
    assert folder.static == run


def test_robots_have_a_row_each_per_tick(recorded):
    folder, run, truths = recorded
    table = folder.robots(1)
    assert table.columns[:6] == ["tick", "time_s", "robot", "group", "x_m", "y_m"]
    assert len(table) == TICKS * run.robots
    for row, name in enumerate(run.robot_names):
        own = table.filter(pl.col("robot") == name)
        at = run.robots + row
        assert own["tick"].to_list() == list(range(TICKS))
        assert own["group"].unique().to_list() == ["flock"]
        assert np.array_equal(own["x_m"], np.array([one.pose[at, 0] for one in truths], np.float32))
        assert np.array_equal(own["command_turn_radps"], np.array([one.command[at, 1] for one in truths], np.float32))
        assert own["alive"].to_list() == [one.alive[at] for one in truths]
        assert own["state"].to_list() == [one.states[one.state[at]] for one in truths]


@pytest.mark.parametrize("since", [0, 2, 6, TICKS - 1, TICKS])
@pytest.mark.parametrize("killed", [False, True])
def test_numbers_that_robots_told_are_recorded_from_the_first_on(tmp_path, monkeypatch, since, killed):
    """In parts of 4 ticks: told in the first, in the midst of one, in a later one, in the last, or never."""
    if killed:
        monkeypatch.setattr(writer, "join_parts", lambda *_: None)
    monkeypatch.setattr(ticks, "MAX_TICKS", 4)
    run, rng = static(3, arenas=2), np.random.default_rng(3)
    values = rng.normal(size=(TICKS, 6))
    values[:since] = np.nan
    values[:, 4] = np.nan
    truths = [
        replace(one, value=values[tick] if tick >= since else None) for tick, one in enumerate(wandering(run, TICKS))
    ]
    record(tmp_path, run, truths)
    folder = RunFolder(tmp_path)
    assert folder.metrics(0).columns == [name for name in folder.metrics(1).columns if name != "value"]
    assert TABLES["ticks"].fault(folder.ticks().lazy(), run) is None
    assert {finding.state for finding in verify(tmp_path) if finding.part == "ticks"} <= {
        TableState.INTACT,
        TableState.PARTIAL,
    }
    if since == TICKS:
        assert "value" not in folder.ticks().columns
        assert "value" not in folder.robots(0).columns
        return
    for arena in range(2):
        own = values[:, arena * 3 : arena * 3 + 3]
        expected = [[None if np.isnan(value) else value for value in row] for row in own]
        assert folder.ticks(arena)["value"].to_list() == expected
        assert folder.robots(arena)["value"].to_list() == [value for row in expected for value in row]


def test_speeds_to_the_left_are_recorded_of_robots_that_can_move_so(tmp_path):
    drive = {"kind": "holonomic", "max_speed_mps": 1, "max_angular_radps": 1, "max_force_n": 1, "max_torque_nm": 1}
    run = static(3, body=body_from({"like": "epuck", "name": "disc", "drive": drive}, "disc.toml"))
    truths = list(wandering(run, 5))
    record(tmp_path, run, truths)
    table = RunFolder(tmp_path).robots()
    left_mps = np.array([one.command[:, 2] for one in truths], np.float32)
    assert np.array_equal(table["command_left_mps"], left_mps.ravel())
    assert "command_left_mps" not in RunFolder(tmp_path).metrics().columns
    assert TABLES["ticks"].fault(pl.scan_parquet(RunFolder(tmp_path).files("ticks")), run) is None


def test_metrics_have_a_row_per_tick_and_no_lists(recorded):
    folder, _, _ = recorded
    table = folder.metrics(1)
    assert table.columns == ["tick", "time_s", *standard_names(), "sent", "received", "in_range"]
    assert table["order"].to_list() == folder.ticks(1)["order"].to_list()


def test_pandas_gets_the_same(recorded):
    pytest.importorskip("pyarrow", reason="comes with the extra [view]")
    folder, _, _ = recorded
    for table in (folder.robots(), folder.metrics(), folder.packets(), folder.events()):
        frame = table.to_pandas()
        assert (len(frame), list(frame.columns)) == (len(table), table.columns)
    frame = folder.robots().to_pandas()
    assert list(frame["robot"][:3]) == ["flock-0", "flock-1", "flock-2"]
    assert frame["x_m"].to_list() == folder.robots()["x_m"].to_list()


def test_summary_is_none_until_the_run_has_ended_and_refused_if_damaged(tmp_path):
    folder = RunFolder(tmp_path)
    assert folder.summary is None
    summary = made_up_summary(3)
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    assert folder.summary == summary
    ends = ([], [3], [{**summary["by_arena"][0], "ticks": None}])
    changed = ({"ticks": -3}, {"arenas": 2}, {"trajectory_sha256": [3]}, *({"by_arena": end} for end in ends))
    less = [{key: value for key, value in summary.items() if key != left_out} for left_out in SUMMARY_KINDS]
    for wrong in ("{", "[]", *map(json.dumps, [*({**summary, **change} for change in changed), *less])):
        (tmp_path / "summary.json").write_text(wrong)
        with refused_input(tmp_path / "summary.json"):
            _ = folder.summary


def test_parts_that_are_joined_while_they_are_read_do_no_harm(recorded, monkeypatch):
    folder, _, _ = recorded
    files, looks = folder.files, []

    def underfoot(name):
        looks.append(name)
        return files(name) if len(looks) > 1 else [folder.path / "ticks" / "part-000099.parquet"]

    monkeypatch.setattr(folder, "files", underfoot)
    assert len(folder.ticks(0)) == TICKS
    assert len(looks) == 2


def test_missing_folder_table_and_static_part_are_named(tmp_path):
    with refused_input(tmp_path / "nowhere"):
        RunFolder(tmp_path / "nowhere")
    with refused_input(key="packets"):
        RunFolder(tmp_path).packets()
    with refused_input(tmp_path / "static.json"):
        _ = RunFolder(tmp_path).static


def test_events_and_packets_of_a_killed_run_without_any_are_empty(tmp_path):
    run = static(2)
    (tmp_path / "ended").mkdir()
    record(tmp_path / "ended", run, wandering(run, 2), packets=1.0)
    for name in ("packets", "events"):
        (tmp_path / name).mkdir()
        table, ended = getattr(RunFolder(tmp_path), name)(), getattr(RunFolder(tmp_path / "ended"), name)()
        assert len(table) == 0
        assert table.schema == ended.schema


def test_damaged_table_and_unknown_arena_are_named(recorded):
    folder, _, _ = recorded
    with refused_input(key="arena"):
        folder.robots(2)
    for file in folder.files("ticks"):
        file.write_bytes(file.read_bytes()[:-9])
    with refused_input(folder.where("ticks")):
        folder.ticks()


def test_record_summary_leaves_out_tables_that_were_not_recorded():
    assert tables.record_summary({"metrics": [], "record_ticks": {"rows": 1}}) == {"ticks": {"rows": 1}}


NUMBER = st.floats(allow_nan=False, allow_infinity=False)
PAIR = st.tuples(NUMBER, NUMBER)
OBSTACLE = st.builds(
    Obstacle,
    st.sampled_from(["cylinder", "box", "polygon"]),
    NUMBER,
    NUMBER,
    NUMBER,
    NUMBER,
    PAIR,
    st.lists(PAIR, max_size=4).map(tuple),
    st.floats(0.0, allow_nan=False),
)
GREY = npst.arrays(np.uint8, npst.array_shapes(min_dims=2, max_dims=2, max_side=4))
PATCH = st.builds(
    Patch, st.sampled_from(["disc", "polygon"]), NUMBER, NUMBER, NUMBER, NUMBER, st.lists(PAIR, max_size=4).map(tuple)
)
FLOOR = st.builds(Floor, NUMBER, st.lists(PATCH, max_size=3).map(tuple), st.none() | GREY.map(packed_image))
LIGHT = st.builds(Light, NUMBER, NUMBER, NUMBER)


def each(item, arenas):
    return st.tuples(*[st.lists(item, max_size=3).map(tuple)] * arenas)


@st.composite
def statics(draw):
    arenas, sizes = draw(st.integers(1, 3)), draw(st.lists(st.integers(1, 4), min_size=1, max_size=3))
    groups, names = [], []
    for number, size in enumerate(sizes):
        body, start = load_body(draw(st.sampled_from(body_names()))), len(names)
        groups.append(Group(f"g{number}", body, start, start + size, draw(st.integers(1, 9))))
        names += [f"g{number}-{index}" for index in range(size)]
    return Static(
        name=draw(st.text()),
        seeds=tuple(draw(st.lists(st.integers(0), min_size=arenas, max_size=arenas, unique=True))),
        rate_hz=draw(st.integers(1, 1000)),
        arena_size_m=draw(PAIR),
        boundary=draw(st.sampled_from(["walls", "open", "torus"])),
        obstacles=draw(each(OBSTACLE, arenas)),
        groups=tuple(groups),
        robot_names=tuple(names),
        range_m=draw(st.none() | NUMBER),
        lights=draw(each(LIGHT, arenas)),
        floor=draw(st.none() | FLOOR),
    )


@given(statics())
@settings(max_examples=40, deadline=None)
def test_static_part_is_read_back_equal(tmp_path_factory, run):
    path = tmp_path_factory.mktemp("run") / "static.json"
    write_static(run, path)
    assert read_static(path) == run
    assert [file.name for file in path.parent.iterdir()] == ["static.json"]


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"wheels": 3}, "wheels"),
        ({"groups": [{"name": "a"}]}, "body"),
        ({"obstacles": None}, ""),
        ({"obstacles": []}, "obstacles"),
        ({"rate_hz": ["g-0"]}, "int"),
        ({"rate_hz": 0}, "rate"),
        ({"robot_names": [["g-0"]]}, "str"),
        ({"robot_names": ["g-0"]}, "groups"),
        ({"range_m": True}, "True"),
    ],
)
def test_damaged_static_part_is_refused_with_its_fault(tmp_path, change, fault):
    path = tmp_path / "static.json"
    write_static(static(2), path)
    path.write_text(json.dumps({**json.loads(path.read_text()), **change}))
    with refused_input(path, match=fault):
        read_static(path)


@pytest.mark.parametrize("text", [None, "", "[1]", "{", "\x00"])
def test_static_file_without_a_json_object_is_refused(tmp_path, text):
    path = tmp_path / "static.json"
    if text is not None:
        path.write_text(text)
    with refused_input(path):
        read_static(path)


OWN = MetricInfo("gas", "what it smells of", "ppm", "count", (0.0, None))


@pytest.mark.parametrize("name", METRICS)
def test_metric_facts_are_read_back_from_run_json(tmp_path, name):
    facts = metric_info(METRICS[name])
    run = {"format": 1, "metrics": [asdict(facts), asdict(OWN)]}
    (tmp_path / "run.json").write_text(json.dumps(run, allow_nan=False))
    assert RunFolder(tmp_path).measured == {name: facts, "gas": OWN}
    least, largest = METRICS[name].bounds
    assert facts.bounds == (None if least == -inf else least, largest)


@pytest.mark.parametrize("metrics", ["", ', "metrics": 3', ', "metrics": [{"name": "gas"}]'])
def test_damaged_list_of_metrics_counts_as_none(tmp_path, metrics):
    (tmp_path / "run.json").write_text(f'{{"format": 1{metrics}}}')
    assert RunFolder(tmp_path).measured == {}


@pytest.mark.parametrize("text", [None, "{", "[]"])
def test_without_a_readable_file_nothing_is_known(tmp_path, text):
    if text is not None:
        (tmp_path / "run.json").write_text(text)
    assert RunFolder(tmp_path).started == RunFolder(tmp_path).measured == {}


def test_axis_of_a_metric_follows_its_recorded_facts():
    facts = {"gas": OWN, "share": MetricInfo("share", "", "", "level", (0.0, 1.0))}
    assert (titled("gas", facts), titled("gas")) == ("gas (ppm)", "gas")
    assert (is_count("gas", facts), is_count("gas")) == (True, False)
    assert limits("share", np.array([0.4]), facts) == limits("order", np.array([0.4])) == (-0.03, 1.05)
    assert limits("share", np.array([0.4]))[1] < 0.5
    assert (titled("min_gap"), is_count("collisions")) == ("min gap (m)", True)


def tables_of_a_run(folder, run_json):
    """The tables of a run of 3 robots in 11 ticks, all of them intact."""
    run = static(3)
    finished = links([0, 1], [2, 0], [5, 6], 0)
    record(folder, run, list(wandering(run, TICKS, finished=finished)), packets=1.0)
    (folder / "run.json").write_text(json.dumps({"format": 1, **run_json}))
    return RunFolder(folder)


def multiply(folder, name, rows):
    """Make the table claim so many rows in next to no bytes: the first again and again."""
    file = folder.path / f"{name}.parquet"
    pl.read_parquet(file).head(1).select(pl.all().repeat_by(rows).explode()).write_parquet(file)


@pytest.mark.parametrize(("name", "most"), [("ticks", TICKS), ("packets", 100 * TICKS * 3 * 3)])
def test_rows_beyond_those_of_the_run_are_refused_unread(tmp_path, name, most):
    folder = tables_of_a_run(tmp_path, {"ticks": TICKS})
    multiply(folder, name, most)
    assert len(folder.table(name)) == most
    multiply(folder, name, most + 1)
    with refused_input(tmp_path / f"{name}.parquet"):
        folder.table(name)
    (finding,) = (row for row in verify(tmp_path) if row.part == name)
    assert finding.state is TableState.DAMAGED
    assert f"{most + 1} rows" in finding.text


def test_rows_of_robots_that_send_more_packets_than_most_are_read(tmp_path):
    run, packets = static(2), 1000
    sent = links([0] * packets, [1] * packets, list(range(packets)), 5)
    record(tmp_path, run, list(wandering(run, 1, finished=sent)), packets=1.0)
    (tmp_path / "run.json").write_text(json.dumps({"format": 1, "ticks": 1}))
    assert RunFolder(tmp_path).packets()["sequence"].to_list() == list(range(packets))
    (finding,) = (row for row in verify(tmp_path) if row.part == "packets")
    assert finding.state is TableState.INTACT


@pytest.mark.parametrize("claimed", [{"ticks": 10**15}, {}])
def test_ticks_that_run_json_alone_claims_are_believed_within_limits(tmp_path, monkeypatch, claimed):
    folder = tables_of_a_run(tmp_path, claimed)
    monkeypatch.setattr(reader, "UNPROVEN_ROBOT_TICKS", 3 * 20)
    multiply(folder, "ticks", 21)
    with pytest.raises(BadInput):
        folder.ticks()
    (tmp_path / "trajectory.digests").write_bytes(bytes(8 * 21))
    assert len(folder.ticks()) == 21


def test_rows_without_a_static_part_are_limited_by_their_lists(tmp_path, monkeypatch):
    tables_of_a_run(tmp_path, {"ticks": TICKS})
    (tmp_path / "static.json").unlink()
    monkeypatch.setattr(reader, "UNPROVEN_ROBOT_TICKS", 3 * (TICKS - 1))
    with pytest.raises(BadInput):
        RunFolder(tmp_path).ticks()

"""Logs are read as far as they are whole; what is no log is refused in one line."""

import json
import shutil

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.metrics.real_log.real_logs import read_real_logs
from tests.support.metrics.real_log.as_logs import as_logs
from tests.support.metrics.real_log.emulated import flock


@pytest.fixture
def folder(tmp_path):
    return as_logs(flock(), tmp_path / "logs")


def told(folder, robot, **changes):
    """Change what a robot says of itself; None takes a key away."""
    path = folder / robot / "robot.json"
    says = {**json.loads(path.read_text()), **changes}
    path.write_text(json.dumps({key: value for key, value in says.items() if value is not None}))


def test_robots_come_in_the_order_of_their_index(folder):
    says = {"robots": [f"flock-{i}" for i in (3, 1, 0, 2, 5, 4)]}
    for robot in range(6):
        told(folder, f"flock-{robot}", **says)
    logs = read_real_logs(folder)
    assert logs.names == tuple(says["robots"])
    assert (logs.rate_hz, logs.notes) == (10.0, ())


def test_a_single_robots_folder_is_a_swarm_of_one(folder):
    logs = read_real_logs(folder / "flock-2")
    assert logs.names == ("flock-2",)
    assert "flock-0, flock-1, flock-3, flock-4 and 1 more" in logs.notes[0]


def test_logs_may_lie_one_deeper_and_of_each_robot_the_newest_start_counts(folder, tmp_path):
    for robot in range(6):
        own = tmp_path / "starts" / f"flock-{robot}"
        own.mkdir(parents=True)
        (folder / f"flock-{robot}").rename(own / "b-first")
        if robot < 2:
            shutil.copytree(own / "b-first", own / "a-second")
            told(own, "a-second", started_utc_ns=2_000_000_000)
        told(own, "b-first", started_utc_ns=1_000_000_000)
    logs = read_real_logs(tmp_path / "starts")
    assert logs.names == tuple(f"flock-{i}" for i in range(6))
    assert [robot.where.endswith("a-second") for robot in logs.robots] == [True, True, False, False, False, False]
    assert [note.endswith(": flock-0/b-first, flock-1/b-first") for note in logs.notes] == [True]
    assert read_real_logs(tmp_path / "starts" / "flock-1").robots[0].where.endswith("a-second")


def test_a_killed_robot_ends_in_half_a_line_which_is_dropped_and_told(folder):
    whole = read_real_logs(folder).robots[1]
    (folder / "flock-1" / "summary.json").unlink()
    for name in ("ticks.csv", "received.csv"):
        path = folder / "flock-1" / name
        path.write_bytes(path.read_bytes()[:-9])
    logs = read_real_logs(folder)
    robot = logs.robots[1]
    assert robot.ended is None
    assert len(robot.steps.time_s) == len(whole.steps.time_s) - 1
    assert len(robot.received.time_s) == len(whole.received.time_s) - 1
    killed, dropped = logs.notes
    assert "summary of flock-1" in killed
    assert "flock-1's ticks.csv, received.csv" in dropped


def test_a_robot_that_was_killed_at_once_wrote_nothing(folder):
    for name in ("ticks.csv", "received.csv", "sent.csv"):
        (folder / "flock-1" / name).write_bytes(b"")
    assert len(read_real_logs(folder).robots[1].steps.time_s) == 0


def test_missing_robots_and_different_agents_are_told(folder):
    told(folder, "flock-0", agent="other:Agent", params={"a": 1})
    (folder / "flock-3" / "robot.json").rename(folder / "robot.json.old")
    for name in ("ticks.csv", "received.csv", "sent.csv", "summary.json"):
        (folder / "flock-3" / name).unlink()
    notes = read_real_logs(folder).notes
    assert "flock-3" in notes[0]
    for told_of in ("other:Agent, swarmwire.agent.behaviours:Flocking", "params"):
        assert any(told_of in note for note in notes)


@pytest.mark.parametrize(
    ("changes", "key", "hint"),
    [
        ({"swarm": "other"}, "swarm", "flock-0"),
        ({"rate_hz": 20}, "rate_hz", "10.0; got 20.0"),
        ({"robots": ["flock-1"]}, "robots", "flock-0"),
        ({"name": "flock-0"}, "name", "flock-0"),
        ({"name": "flock-9"}, "name", "flock-9"),
        ({"rate_hz": 0}, "rate_hz", "0 Hz"),
        ({"agent": None}, "agent", ""),
        ({"body": {}}, "name", ""),
    ],
)
def test_robots_of_different_kinds_of_runs_are_refused_with_file_and_key(folder, changes, key, hint):
    told(folder, "flock-1", **changes)
    with pytest.raises(BadInput) as refused:
        read_real_logs(folder)
    assert refused.value.where == str(folder / "flock-1" / "robot.json")
    assert key in refused.value.key
    assert hint in refused.value.expected


@pytest.mark.parametrize(
    ("name", "row", "told_of"),
    [
        ("ticks.csv", "9,soon,0,,,,1,0,0,,,", "t_s"),
        ("ticks.csv", "9,5.0,0,,,,1,0,0,,,", "t_s"),
        ("ticks.csv", "9,1e300,0,,,,1,0,0,,,", "t_s"),
        ("received.csv", "9.0,flock-0,flock-1,1.5,,14,say,0.1,1.0,1", "seq"),
        ("received.csv", "9.0,flock-0,flock-1,1,,14,say,inf,1.0,1", "latency_s"),
        ("sent.csv", "9.0,flock-1,,,14,say,sent", "seq"),
        ("sent.csv", "9.0,flock-1,1,,14,say,sent,and,more", ""),
    ],
)
def test_rows_that_cannot_be_are_refused_with_their_place(folder, name, row, told_of):
    path = folder / "flock-1" / name
    path.write_text(f"{path.read_text()}{row}\n")
    with pytest.raises(BadInput) as refused:
        read_real_logs(folder)
    assert refused.value.where == str(path)
    assert told_of in refused.value.key


def test_what_is_no_log_is_refused(folder, tmp_path):
    (tmp_path / "other" / "deeper" / "still").mkdir(parents=True)
    for path in (tmp_path / "nowhere", tmp_path / "other"):
        with pytest.raises(BadInput, check=lambda error, path=path: error.where == str(path)):
            read_real_logs(path)
    (folder / "flock-1" / "robot.json").unlink()
    with pytest.raises(
        BadInput, check=lambda error: (error.where, error.key) == (str(folder / "flock-1"), "robot.json")
    ):
        read_real_logs(folder)
    told(folder, "flock-2")
    (folder / "flock-1").rename(tmp_path / "away")
    for text in ("{", "[]"):
        (folder / "flock-2" / "robot.json").write_text(text)
        with pytest.raises(BadInput, check=lambda error: error.where == str(folder / "flock-2" / "robot.json")):
            read_real_logs(folder)

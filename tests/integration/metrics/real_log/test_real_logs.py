import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.base.errors import CustomCodeFailed
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.measures.registry import METRICS
from swarmwire.metrics.real.real_log.real_logs import read_real_logs
from swarmwire.metrics.real.real_log.truths import real_run
from swarmwire.metrics.real.sim_to_real.runs import measured_log, missing_data
from tests.support.metrics.real_logs import as_logs, flock, measured_run
from tests.support.refusals import refused_input

LOGGED = {"poses", "commands", "packets", "latency"}  # what the logs of robots have
OF_POSES = ("order", "order_velocity", "speed", "cohesion", "min_gap")
OF_PACKETS = ("pdr", "link_pdr", "throughput", "age_of_information")
NAMES = (*OF_POSES, *OF_PACKETS)
MEASURES = [METRICS[name]() for name in (*NAMES, "latency_air", "collisions", "components", "airtime")]
PHASES_S = (0.03, 0.0, 0.09, 0.05, 0.01, 0.07)


@pytest.fixture
def folder(tmp_path):
    return as_logs(flock(), tmp_path / "logs")


def change_facts(folder, robot, **changes):
    """Change what a robot says of itself; None takes a key away."""
    path = folder / robot / "robot.json"
    says = {**json.loads(path.read_text()), **changes}
    path.write_text(json.dumps({key: value for key, value in says.items() if value is not None}))


def test_robots_come_in_the_order_of_their_index(folder):
    says = {"robots": [f"flock-{i}" for i in (3, 1, 0, 2, 5, 4)]}
    for robot in range(6):
        change_facts(folder, f"flock-{robot}", **says)
    logs = read_real_logs(folder)
    assert logs.names == tuple(says["robots"])
    assert (logs.rate_hz, logs.notes) == (10.0, ())


def test_single_robots_folder_is_a_swarm_of_one(folder):
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
            change_facts(own, "a-second", started_utc_ns=2_000_000_000)
        change_facts(own, "b-first", started_utc_ns=1_000_000_000)
    logs = read_real_logs(tmp_path / "starts")
    assert logs.names == tuple(f"flock-{i}" for i in range(6))
    assert [robot.where.endswith("a-second") for robot in logs.robots] == [True, True, False, False, False, False]
    assert [note.endswith(": flock-0/b-first, flock-1/b-first") for note in logs.notes] == [True]
    assert read_real_logs(tmp_path / "starts" / "flock-1").robots[0].where.endswith("a-second")


def test_killed_robots_half_written_line_is_dropped_with_a_note(folder):
    complete = read_real_logs(folder).robots[1]
    (folder / "flock-1" / "summary.json").unlink()
    for name in ("ticks.csv", "received.csv"):
        path = folder / "flock-1" / name
        path.write_bytes(path.read_bytes()[:-9])
    logs = read_real_logs(folder)
    robot = logs.robots[1]
    assert robot.ended is None
    assert len(robot.steps.time_s) == len(complete.steps.time_s) - 1
    assert len(robot.received.time_s) == len(complete.received.time_s) - 1
    killed, dropped = logs.notes
    assert "summary of flock-1" in killed
    assert "flock-1's ticks.csv, received.csv" in dropped


def test_empty_logs_of_a_robot_killed_at_once_are_read(folder):
    for name in ("ticks.csv", "received.csv", "sent.csv"):
        (folder / "flock-1" / name).write_bytes(b"")
    assert len(read_real_logs(folder).robots[1].steps.time_s) == 0


def test_missing_robots_and_different_agents_are_told(folder):
    change_facts(folder, "flock-0", agent="other:Agent", params={"a": 1})
    (folder / "flock-3" / "robot.json").rename(folder / "robot.json.old")
    for name in ("ticks.csv", "received.csv", "sent.csv", "summary.json"):
        (folder / "flock-3" / name).unlink()
    notes = read_real_logs(folder).notes
    assert "flock-3" in notes[0]
    for message in ("other:Agent, swarmwire.agent.behaviours:Flocking", "params"):
        assert any(message in note for note in notes)


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
    change_facts(folder, "flock-1", **changes)
    with refused_input(folder / "flock-1" / "robot.json", match=f"{key}.*{hint}"):
        read_real_logs(folder)


@pytest.mark.parametrize(
    ("name", "row", "message"),
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
def test_rows_that_cannot_be_are_refused_with_their_place(folder, name, row, message):
    path = folder / "flock-1" / name
    path.write_text(f"{path.read_text()}{row}\n")
    with refused_input(path, match=message):
        read_real_logs(folder)


def test_folder_without_a_real_log_is_refused(folder, tmp_path):
    (tmp_path / "other" / "deeper" / "still").mkdir(parents=True)
    for path in (tmp_path / "nowhere", tmp_path / "other"):
        with refused_input(path):
            read_real_logs(path)
    (folder / "flock-1" / "robot.json").unlink()
    with refused_input(folder / "flock-1", "robot.json"):
        read_real_logs(folder)
    change_facts(folder, "flock-2")
    (folder / "flock-1").rename(tmp_path / "away")
    for text in ("{", "[]"):
        (folder / "flock-2" / "robot.json").write_text(text)
        with refused_input(folder / "flock-2" / "robot.json"):
            read_real_logs(folder)


@pytest.fixture(scope="module")
def emulated():
    """The series of the run, and its account of the radio."""
    return measured_run(flock(), [METRICS[name]() for name in NAMES])


@pytest.fixture(scope="module")
def real(tmp_path_factory):
    """The logs of the run, as observers would see them."""
    return real_run(read_real_logs(as_logs(flock(), tmp_path_factory.mktemp("logs"))), flock().static)


@pytest.fixture(scope="module")
def of_run():
    """The series of all metrics in the run."""
    values = measures(flock().static, flock().truths, [kind() for kind in METRICS.values()])
    return dict(zip(METRICS, values.T, strict=True))


def measures(static, truths, metrics) -> np.ndarray:
    """The values of metrics, (ticks, metrics); NaN of one that cannot do with what it is given."""
    observer, values = Metrics(metrics), []
    observer.begin(static)
    try:
        for truth in truths:
            observer.see(truth)
            values.append(observer.values[:, 0].copy())
    except CustomCodeFailed:
        return np.full((1, len(metrics)), np.nan)
    return np.array(values)


def measured(folder, arena=True, **how):
    return measured_log(read_real_logs(as_logs(flock(), folder, **how)), MEASURES, flock().static if arena else None)


def test_logs_of_robots_in_step_measure_as_the_run_did(tmp_path, emulated):
    series, radio = emulated
    log = measured(tmp_path)
    assert log.notes == ()
    for name in ("order", "cohesion", "min_gap", "throughput", "age_of_information"):
        np.testing.assert_allclose(log.series[name], series[name], rtol=1e-5, atol=1e-5, err_msg=name)
    # Differences of positions are speeds between ticks, not at them.
    assert np.nanmean(log.series["speed"]) == pytest.approx(np.nanmean(series["speed"]), rel=0.03)
    assert log.radio["fates"]["received"] == radio["fates"]["received"]
    assert log.radio["latency_air_s"] == radio["latency_air_s"]


def test_robots_that_step_when_they_like_measure_within_the_error_of_interpolation(tmp_path, emulated):
    series, _ = emulated
    log = measured(tmp_path, phase_s=PHASES_S)
    assert log.static.robot_names == flock().static.robot_names
    for name, within in (("order", 0.03), ("cohesion", 0.01), ("min_gap", 0.01)):
        assert np.nanmean(np.abs(log.series[name] - series[name][: len(log.series[name])])) < within, name


def test_measures_that_a_log_cannot_know_are_left_out_and_never_0(tmp_path):
    log = measured(tmp_path)
    assert set(log.left_out) == {"collisions", "components", "airtime"}
    assert not set(log.left_out) & set(log.series)
    assert log.radio["intended"] == log.radio["in_range"] + log.radio["fates"]["in_flight"]


@pytest.mark.parametrize("name", METRICS)
def test_metric_of_a_log_is_that_of_the_run_or_left_out_for_missing_data(name, real, of_run):
    metric = METRICS[name]()
    values = measures(real.static, real.truths(), [metric])
    if missing_data(metric, LOGGED) is not None:
        assert np.isnan(values).all()
    elif np.isfinite(of_run[name]).any():
        assert np.nanmean(values) == pytest.approx(np.nanmean(of_run[name]), rel=0.05, abs=0.05)


@pytest.mark.parametrize(
    "name", [name for name in METRICS if missing_data(METRICS[name](), LOGGED - {"poses"}) is None]
)
def test_metric_measured_without_poses_does_not_depend_on_them(name, real):
    metric, unknown = METRICS[name](), np.full_like(real._motion.pose, np.nan)
    blind = replace(real, _motion=replace(real._motion, pose=unknown, velocity=unknown))
    with_poses, without = (measures(real.static, log.truths(), [metric]) for log in (real, blind))
    np.testing.assert_array_equal(with_poses, without)


def test_without_a_tracker_the_radio_is_measured_and_nothing_else(tmp_path):
    log = measured(tmp_path, tracker=False)
    assert set(log.series) == {*OF_PACKETS, "latency_air"}
    assert "tracker" in log.left_out["order"]
    assert [("tracker" in note) for note in log.notes] == [True]
    assert log.radio["fates"]["received"] > 1000


def test_clocks_that_are_apart_are_told_and_set_right(tmp_path, emulated):
    series, radio = emulated
    log = measured(tmp_path, ahead_s={"flock-2": 0.3})
    (note,) = log.notes
    assert "flock-2 +0.3" in note
    assert log.radio["latency_air_s"]["p50"] == pytest.approx(radio["latency_air_s"]["p50"], abs=0.003)
    assert np.nanmean(np.abs(log.series["cohesion"] - series["cohesion"][: len(log.series["cohesion"])])) < 0.01


def test_robot_without_a_log_is_missing_from_the_packet_counts(tmp_path, emulated):
    folder = as_logs(flock(), tmp_path)
    (folder / "flock-4").rename(tmp_path.parent / f"{tmp_path.name}-away")
    log = measured_log(read_real_logs(folder), MEASURES)
    assert ["flock-4" in note for note in log.notes] == [True]
    assert log.static.robots == 5
    assert log.radio["sent"] == pytest.approx(5 / 6 * emulated[1]["sent"], rel=0.02)
    assert log.radio["intended"] == 4 * log.radio["sent"]
    assert log.radio["pdr"] == pytest.approx(0.7, abs=0.1)


def test_robot_that_was_killed_ends_the_comparison_for_all(tmp_path):
    folder = as_logs(flock(), tmp_path)
    path = folder / "flock-3" / "ticks.csv"
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:102]))
    log = measured_log(read_real_logs(folder), MEASURES)
    assert log.duration_s == 10.0
    assert ["9.9 s" in note and "flock-3" in note for note in log.notes] == [True]


def test_robots_that_never_ran_together_are_refused(tmp_path):
    folder = as_logs(flock(), tmp_path)
    path = folder / "flock-3" / "ticks.csv"
    path.write_text(path.read_text().replace(",17672256", ",17672266").replace(",17672257", ",17672267"))
    with refused_input(folder, match="flock-3"):
        measured_log(read_real_logs(folder), MEASURES)


def test_logs_that_last_for_years_are_refused_as_a_clock_was_set(tmp_path):
    folder = as_logs(flock(), tmp_path / "logs")
    for path in folder.glob("*/ticks.csv"):
        path.write_text(f"{path.read_text()}999,8e9,0,0.0,0.0,0.0,1,0,0,,,\n")
    with refused_input(folder, "t_s"):
        measured_log(read_real_logs(folder), MEASURES)


def test_nobody_tells_the_arena_and_it_holds_the_robots(tmp_path):
    log = measured(tmp_path, arena=False)
    assert log.static.boundary == "open"
    assert min(log.static.arena_size_m) > 2.0

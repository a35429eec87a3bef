"""What a run's robots logged is measured as the run was."""

from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.errors import BadInput, CustomCodeFailed
from swarmwire.metrics.measure import Metrics
from swarmwire.metrics.network.radio_tally import RadioTally
from swarmwire.metrics.real_log.measured_log import measured_log, why_not
from swarmwire.metrics.real_log.real_logs import read_real_logs
from swarmwire.metrics.real_log.truths import real_run
from swarmwire.metrics.registry import METRICS
from tests.support.metrics.real_log.as_logs import as_logs
from tests.support.metrics.real_log.emulated import flock

NAMES = (
    "order",
    "order_velocity",
    "speed",
    "cohesion",
    "min_gap",
    "pdr",
    "link_pdr",
    "throughput",
    "age_of_information",
)
MEASURES = [METRICS[name]() for name in (*NAMES, "latency_air", "collisions", "components", "airtime")]
PHASES_S = (0.03, 0.0, 0.09, 0.05, 0.01, 0.07)


@pytest.fixture(scope="module")
def emulated():
    """The series of the run, and its account of the radio."""
    metrics, tally = Metrics([METRICS[name]() for name in NAMES]), RadioTally()
    series = []
    for observer in (metrics, tally):
        observer.begin(flock().static)
    for truth in flock().truths:
        metrics.see(truth)
        tally.see(truth)
        series.append(metrics.values[:, 0].copy())
    return dict(zip(NAMES, np.array(series).T, strict=True)), tally.end(None)["radio"][0]


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
    of, values = Metrics(metrics), []
    of.begin(static)
    try:
        for truth in truths:
            of.see(truth)
            values.append(of.values[:, 0].copy())
    except CustomCodeFailed:
        return np.full((1, len(metrics)), np.nan)
    return np.array(values)


def measured(folder, place=True, **how):
    return measured_log(read_real_logs(as_logs(flock(), folder, **how)), MEASURES, flock().static if place else None)


def test_logs_of_robots_in_step_measure_as_the_run_did(tmp_path, emulated):
    series, radio = emulated
    of = measured(tmp_path)
    assert of.notes == ()
    for name in ("order", "cohesion", "min_gap", "throughput", "age_of_information"):
        np.testing.assert_allclose(of.series[name], series[name], rtol=1e-5, atol=1e-5, err_msg=name)
    # Differences of positions are speeds between ticks, not at them.
    assert np.nanmean(of.series["speed"]) == pytest.approx(np.nanmean(series["speed"]), rel=0.03)
    assert of.radio["fates"]["received"] == radio["fates"]["received"]
    assert of.radio["latency_air_s"] == radio["latency_air_s"]


def test_robots_that_step_when_they_like_measure_within_the_error_of_interpolation(tmp_path, emulated):
    series, _ = emulated
    of = measured(tmp_path, phase_s=PHASES_S)
    assert of.static.robot_names == flock().static.robot_names
    for name, within in (("order", 0.03), ("cohesion", 0.01), ("min_gap", 0.01)):
        assert np.nanmean(np.abs(of.series[name] - series[name][: len(of.series[name])])) < within, name


def test_what_a_log_cannot_know_is_left_out_with_the_reason_and_never_0(tmp_path):
    of = measured(tmp_path)
    assert set(of.left_out) == {"collisions", "components", "airtime"}
    assert not set(of.left_out) & set(of.series)
    assert of.radio["intended"] == of.radio["in_range"] + of.radio["fates"]["in_flight"]


@pytest.mark.parametrize("name", METRICS)
def test_every_metric_is_measured_as_in_the_run_or_left_out_since_the_log_lacks_what_it_reads(name, real, of_run):
    metric = METRICS[name]()
    found = measures(real.static, real.truths(), [metric])
    if why_not(metric, has_poses=True) is not None:
        assert np.isnan(found).all()
    elif np.isfinite(of_run[name]).any():
        assert np.nanmean(found) == pytest.approx(np.nanmean(of_run[name]), rel=0.05, abs=0.05)


@pytest.mark.parametrize("name", [name for name in METRICS if why_not(METRICS[name](), has_poses=False) is None])
def test_what_is_measured_without_poses_needs_none(name, real):
    metric, unknown = METRICS[name](), np.full_like(real._motion.pose, np.nan)
    blind = replace(real, _motion=replace(real._motion, pose=unknown, velocity=unknown))
    with_poses, without = (measures(real.static, of.truths(), [metric]) for of in (real, blind))
    np.testing.assert_array_equal(with_poses, without)


def test_without_a_tracker_the_radio_is_measured_and_nothing_else(tmp_path):
    of = measured(tmp_path, tracker=False)
    assert set(of.series) == {"pdr", "link_pdr", "throughput", "age_of_information", "latency_air"}
    assert "tracker" in of.left_out["order"]
    assert [("tracker" in note) for note in of.notes] == [True]
    assert of.radio["fates"]["received"] > 1000


def test_clocks_that_are_apart_are_told_and_set_right(tmp_path, emulated):
    series, radio = emulated
    of = measured(tmp_path, ahead_s={"flock-2": 0.3})
    (note,) = of.notes
    assert "flock-2 +0.3" in note
    assert of.radio["latency_air_s"]["p50"] == pytest.approx(radio["latency_air_s"]["p50"], abs=0.003)
    assert np.nanmean(np.abs(of.series["cohesion"] - series["cohesion"][: len(of.series["cohesion"])])) < 0.01


def test_a_robot_without_a_log_takes_its_packets_along(tmp_path, emulated):
    folder = as_logs(flock(), tmp_path)
    (folder / "flock-4").rename(tmp_path.parent / f"{tmp_path.name}-away")
    of = measured_log(read_real_logs(folder), MEASURES)
    assert ["flock-4" in note for note in of.notes] == [True]
    assert of.static.robots == 5
    assert of.radio["sent"] == pytest.approx(5 / 6 * emulated[1]["sent"], rel=0.02)
    assert of.radio["intended"] == 4 * of.radio["sent"]
    assert of.radio["pdr"] == pytest.approx(0.7, abs=0.1)


def test_a_robot_that_was_killed_ends_the_comparison_for_all(tmp_path):
    folder = as_logs(flock(), tmp_path)
    path = folder / "flock-3" / "ticks.csv"
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:102]))
    of = measured_log(read_real_logs(folder), MEASURES)
    assert of.duration_s == 10.0
    assert ["9.9 s" in note and "flock-3" in note for note in of.notes] == [True]


def test_robots_that_never_ran_together_are_refused(tmp_path):
    folder = as_logs(flock(), tmp_path)
    path = folder / "flock-3" / "ticks.csv"
    path.write_text(path.read_text().replace(",17672256", ",17672266").replace(",17672257", ",17672267"))
    with pytest.raises(BadInput, check=lambda error: error.where == str(folder) and "flock-3" in error.expected):
        measured_log(read_real_logs(folder), MEASURES)


def test_logs_that_last_for_years_are_refused_as_a_clock_was_set(tmp_path):
    folder = as_logs(flock(), tmp_path / "logs")
    for path in folder.glob("*/ticks.csv"):
        path.write_text(f"{path.read_text()}999,8e9,0,0.0,0.0,0.0,1,0,0,,,\n")
    with pytest.raises(BadInput, check=lambda error: (error.where, error.key) == (str(folder), "t_s")):
        measured_log(read_real_logs(folder), MEASURES)


def test_nobody_tells_the_arena_and_it_holds_the_robots(tmp_path):
    of = measured(tmp_path, place=False)
    assert of.static.boundary == "open"
    assert min(of.static.arena_size_m) > 2.0

"""What an emulated network was made with is found again in its robots' logs. Seeds are fixed; tolerances are four
standard errors as the fit states them (false alarm 1 in 16 000 each), and those are held to what such logs can tell.
"""

import numpy as np
import pytest

from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.cli.actions.radio_fit import network_comments, network_rows, network_table
from swarmwire.metrics.real.radio_fit.delay import LatencyFit, fit_latency
from swarmwire.metrics.real.radio_fit.fit import NetworkFit, RangeFit, deliveries, fit_network, fit_range
from swarmwire.metrics.real.radio_fit.logs import (
    NetworkLog,
    is_network_table,
    network_log_of_robots,
    network_log_of_table,
)
from swarmwire.metrics.real.radio_fit.losses import LossFit
from swarmwire.metrics.real.real_log.real_logs import read_real_logs
from tests.statistics.metrics.radio_fit.test_radio_fit import is_found
from tests.support.metrics.real_logs import BEGAN_S, as_logs, flock, watched

AIRTIME_S = 14 * 8 / 250_000  # of a beacon, which the radio adds to its latency
HEAD = "t_s,tx,rx,seq,to,size_bytes,tag,latency_s,distance_m,given\n"


def logged(flock_run, folder, **how) -> NetworkLog:
    return network_log_of_robots(read_real_logs(as_logs(flock_run, folder, **how)))


def fitted(flock_run, folder, **how) -> NetworkFit:
    return fit_network(logged(flock_run, folder, **how))


@pytest.fixture(scope="module")
def bursty():
    """Bursts of half a second that lose all, every two seconds; robots start all over the place."""
    bursts = "radio.bursts={ bad_s = 0.5, good_s = 2.0 }"
    start = 'robots.flock.place={ how = "arena" }'
    return watched("radio.loss=0.0", bursts, start, "duration_s=40", seed=3)


@pytest.fixture(scope="module")
def fit(bursty, tmp_path_factory):
    return fitted(bursty, tmp_path_factory.mktemp("bursty"), phase_s=(0.03, 0.0, 0.09, 0.05, 0.01, 0.07))


@pytest.fixture(scope="module")
def steady(tmp_path_factory):
    """Single losses, and nobody out of range."""
    return fitted(flock(), tmp_path_factory.mktemp("steady"))


def test_network_fit_recovers_single_losses_latency_and_jitter(steady):
    network = steady
    assert isinstance(network.losses, LossFit)
    assert isinstance(network.latency, LatencyFit)
    assert is_found(network.losses.loss, 0.3, 0.05)
    assert network.losses.chosen.bursts is None
    latency_s, error_s = network.latency.latency_s
    assert abs(latency_s - 0.1 - AIRTIME_S) < 4.0 * error_s < 0.001
    assert is_found(network.latency.jitter_s, 0.02, 0.05)
    assert network.latency.ks_distance < 0.05


def test_network_fit_has_a_row_per_parameter_and_comments(steady):
    rows = {row.parameter: row for row in network_rows(steady)}
    assert {"range, at least", "latency", "jitter"} <= rows.keys()
    assert rows["latency"].unit == "s"
    assert all(bool(row.left_out) == (row.estimate is None) for row in rows.values())
    assert any(comment.startswith("range_m is the farthest") for comment in network_comments(steady))


def test_network_fit_recovers_bursts(fit):
    assert isinstance(fit.losses, LossFit)
    bursts, errors = fit.losses.chosen.bursts, fit.losses.chosen.errors
    assert fit.losses.chosen.name == "bursts that lose all"
    assert bursts is not None
    assert is_found((bursts.bad_s, errors["bad_s"]), 0.5, 0.2)
    assert is_found((bursts.good_s, errors["good_s"]), 2.0, 0.2)


def test_network_fit_recovers_the_range_from_packets_beyond_it(fit):
    assert isinstance(fit.range, RangeFit)
    assert fit.range.reached
    assert fit.range.range_m.value == pytest.approx(2.0, abs=0.05)
    assert any("from beyond the range count as out of range" in note for note in fit.notes)


def test_network_fit_gives_a_lower_bound_of_the_range_otherwise(steady):
    network = steady
    assert isinstance(network.range, RangeFit)
    assert not network.range.reached
    assert network.range.range_m.value == pytest.approx(np.nanmax(network.log.distance_m), rel=0.02)
    assert network_table(network)["radio"]["range_m"] == pytest.approx(network.range.range_m.value, rel=1e-3)


def test_network_fit_without_distances_has_all_in_range(tmp_path):
    network = fitted(flock(), tmp_path, tracker=False)
    assert network.range == "needs 100 packets with a distance, got 0"
    table = network_table(network)["radio"]
    assert table["range_m"] == 1000.0
    assert table["loss"] == pytest.approx(0.3, abs=0.03)


def test_network_fit_ignores_packets_before_links_are_up(tmp_path):
    folder, until_s = as_logs(flock(), tmp_path), BEGAN_S + 5.0
    for file in folder.glob("*/received.csv"):
        rows = file.read_text().splitlines(keepends=True)
        ends = [(row.split(",")[:3], row) for row in rows[1:]]
        up = [row for (at_s, tx, rx), row in ends if float(at_s) > until_s or "flock-0" not in (tx, rx)]
        file.write_text("".join([rows[0], *up]))
    fit = fit_network(network_log_of_robots(read_real_logs(folder)))
    assert isinstance(fit.losses, LossFit)
    assert is_found(fit.losses.loss, 0.3, 0.05)
    assert fit.losses.chosen.bursts is None


def test_network_fit_lists_delivery_by_link_and_neighbours(steady):
    network = steady
    assert len(network.links) == 30
    assert sum(link.packets for link in network.links) == len(network.log.lost)
    assert all(0.5 < link.pdr < 0.9 for link in network.links)
    assert network.neighbours["flock-0"] == tuple(f"flock-{i}" for i in range(1, 6))


def test_network_fit_of_one_log_lists_received_robots_as_neighbours(tmp_path):
    network = fit_network(network_log_of_robots(read_real_logs(as_logs(flock(), tmp_path) / "flock-0")))
    assert network.neighbours["flock-0"] == tuple(f"flock-{i}" for i in range(1, 6))
    assert network.neighbours["flock-1"] == ("flock-0",)  # of the others nothing is known


def test_network_fit_requires_both_directions_for_neighbours(tmp_path):
    folder = as_logs(flock(), tmp_path)
    (folder / "flock-1" / "received.csv").write_text(HEAD)  # it is there, and received nobody
    assert "flock-1" not in fit_network(network_log_of_robots(read_real_logs(folder))).neighbours["flock-0"]


def test_network_fit_with_a_tracker_has_range_and_bearing(steady, tmp_path):
    assert network_table(steady)["radio"]["measures"] == {"range": {}, "bearing": {}}
    assert any(comment.startswith("measures: ") for comment in network_comments(steady))
    blind = fitted(flock(), tmp_path, tracker=False)
    assert "measures" not in network_table(blind)["radio"]
    assert not any(comment.startswith("measures: ") for comment in network_comments(blind))


def test_network_fit_aligns_clocks_before_latencies(tmp_path):
    log = logged(flock(), tmp_path, ahead_s={"flock-1": 0.3, "flock-4": -0.05})
    assert "clocks up to 0.35 s apart" in log.notes[0]
    latency = fit_latency(log.packets.latency_s)
    assert isinstance(latency, LatencyFit)
    assert latency.latency_s.value == pytest.approx(0.1 + AIRTIME_S, abs=0.003)
    assert latency.jitter_s.value == pytest.approx(0.02, abs=0.004)


def test_network_fit_of_other_latencies_gives_a_delay_table(tmp_path):
    draws = np.random.default_rng(4).lognormal(-4.0, 0.8, 2000)
    rows = [f"{1000.0 + 0.1 * i:.9f},a,b,{i},,14,say,{late_s:.9f},1.0,1\n" for i, late_s in enumerate(draws)]
    path = tmp_path / "received.csv"
    path.write_text(HEAD + "".join(rows))
    network = fit_network(network_log_of_table(path))
    table = network_table(network)["radio"]
    assert table["delays"]["distribution"] == "lognormal"
    whole_s = table["latency_s"] + table["delays"]["mean_s"]
    assert (whole_s, table["jitter_s"]) == (pytest.approx(float(draws.mean()), rel=0.05), 0.0)
    assert any("[radio.delays] is lognormal" in note for note in network.notes)
    assert "lognormal delay, mean" in {row.parameter for row in network_rows(network)}


def test_latency_fit_reports_negative_latencies():
    latency = fit_latency(np.linspace(-0.31, -0.29, 200))
    assert isinstance(latency, LatencyFit)
    assert (latency.latency_s.value, latency.negative) == (0.0, 1.0)


def test_latency_fit_is_robust_against_a_few_late_packets():
    draws = np.random.default_rng(2).uniform(0.01, 0.03, 4000)
    draws[::40] += 2.0
    latency = fit_latency(draws)
    assert isinstance(latency, LatencyFit)
    assert latency.latency_s.value == pytest.approx(0.01, abs=0.001)
    assert latency.jitter_s.value == pytest.approx(0.02, abs=0.0015)
    assert latency.percentiles_s[2] > 1.0


def test_network_log_that_is_missing_leaves_links_to_others(tmp_path):
    folder = as_logs(flock(), tmp_path / "logs")
    (folder / "flock-4").rename(tmp_path / "away")
    links = deliveries(network_log_of_robots(read_real_logs(folder)))
    from_there = [link for link in links if link.sender == "flock-4"]
    assert {link.receiver for link in from_there} == {f"flock-{i}" for i in (0, 1, 2, 3, 5)}
    assert not [link for link in links if link.receiver == "flock-4"]
    assert all(0.5 < link.pdr < 0.9 for link in from_there)


def test_network_log_counts_packets_beyond_the_first_and_last_received(tmp_path):
    folder = as_logs(flock(), tmp_path)
    path = folder / "flock-1" / "received.csv"
    head, *rows = path.read_text().splitlines(keepends=True)
    middle = [row for row in rows if 30 <= int(row.split(",")[3]) < 60]
    path.write_text("".join([head, *middle]))
    links = deliveries(network_log_of_robots(read_real_logs(folder)))
    into = [link for link in links if link.receiver == "flock-1"]
    assert all(190 <= link.packets <= 200 and 10 <= link.received <= 30 for link in into)
    (table,) = [network_log_of_table(path)]
    assert max(np.bincount(table.packets.sender)) <= 30  # the table alone tells nothing of the others


def test_network_log_of_a_restarted_agent_has_no_losses(tmp_path):
    """Its numbers fall to 0: the packets before and after are counted, none between."""
    rows = [f"{1000.0 + 0.1 * i:.9f},a,b,{i if i < 200 else i - 200},,14,say,0.01,1.0,1\n" for i in range(400)]
    path = tmp_path / "received.csv"
    path.write_text(HEAD + "".join(rows))
    log = network_log_of_table(path)
    assert (len(log.lost), int(log.lost.sum())) == (400, 0)


def test_network_log_accepts_late_and_repeated_rows(tmp_path):
    sent = [*range(150), 7, 3]
    rows = [f"{1000.0 + 0.1 * i + (0.35 if i % 50 == 9 else 0.01):.9f},a,b,{i}\n" for i in sent if i % 10]
    path = tmp_path / "received.csv"
    path.write_text("t_s,tx,rx,seq\n" + "".join(rows) + "9")
    log = network_log_of_table(path)
    assert len(log.lost) == 149  # from the first that was received to the last
    assert int(log.lost.sum()) == 14
    assert log.notes == ("half a line at the end was dropped",)
    assert np.isnan(log.distance_m).all()


def test_range_fit_finds_the_step_of_delivery():
    distance_m = np.linspace(0.1, 4.0, 2000)
    lost = (distance_m > 2.5) | (np.arange(2000) % 3 == 0)
    step = fit_range(distance_m, lost)
    assert isinstance(step, RangeFit)
    assert step.range_m.value == pytest.approx(2.5, abs=0.01)
    lost[1900] = False  # one from afar
    stray = fit_range(distance_m, lost)
    assert isinstance(stray, RangeFit)
    assert stray.range_m.value == step.range_m.value
    assert fit_range(distance_m, np.ones(2000, np.bool_)) == "needs packets that were received"


def test_network_tables_are_recognized_by_their_columns(tmp_path):
    for name, head, is_network in (
        ("a.csv", HEAD, True),
        ("b.csv", "t_s,tx,rx,seq\n", True),
        ("c.csv", "t_s,tx,rx,seq,rssi_dbm,distance_m\n", False),
        ("d.csv", "t_s,tx,rx\n", False),
        ("e.csv", "\ufefft_s,tx,rx,seq\r\n", True),  # of a spreadsheet
        ("f.csv", '"t_s","tx","rx","seq"\n', True),  # of R's write.csv
        ("g.csv", "", False),
    ):
        (tmp_path / name).write_text(head)
        assert is_network_table(tmp_path / name) == is_network
    assert not is_network_table(tmp_path / "absent.csv")


def test_network_log_of_spreadsheets_and_of_r_equals_a_plain_one(tmp_path):
    rows = ["t_s,tx,rx,seq,distance_m", "0.0,a,b,0,5.362", "0.2,a,b,2,1.87", "0.3,b,a,1,1.5", "0.6,b,a,2,2"]
    quoted = [",".join(f'"{name}"' for name in rows[0].split(",")), *(row.replace("a", '"a"') for row in rows[1:])]
    logs = []
    for name, lines, end, encoding in (
        ("plain", rows, "\n", "utf-8"),
        ("spreadsheet", rows, "\r\n", "utf-8-sig"),
        ("quoted", quoted, "\n", "utf-8"),
    ):
        path = tmp_path / f"{name}.csv"
        path.write_text(end.join(lines) + end, encoding=encoding, newline="")
        assert is_network_table(path)
        logs.append(network_log_of_table(path))
    plain, *others = logs
    assert plain.lost.tolist() == [False, True, False, False, False]  # seq 1 of a to b
    for log in others:
        assert log.lost.tolist() == plain.lost.tolist()
        assert log.distance_m.tolist() == pytest.approx(plain.distance_m.tolist(), nan_ok=True)


def test_network_log_with_impossible_losses_is_refused(tmp_path):
    path = tmp_path / "received.csv"
    path.write_text("t_s,tx,rx,seq\n1.0,a,b,1\n2.0,a,b,900000000\n")
    with pytest.raises(BadInput, match="leaves 899999998 packets out"):
        network_log_of_table(path)
    path.write_text("t_s,tx,rx,seq\n1.0,a,a,1\n")
    with pytest.raises(BadInput, match="expected another robot than tx"):
        network_log_of_table(path)

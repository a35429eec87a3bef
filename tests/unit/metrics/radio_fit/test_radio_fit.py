"""Logs of packets are read whole or refused in one line; delays that are not uniform are found again."""

import numpy as np
import polars as pl
import pytest

from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.radio.config.impairments import Delays
from swarmwire.comms.radio.stages.delays import delay_distribution, varying_delay_ns
from swarmwire.metrics.real.radio_fit.delay import LatencyFit, fit_delays, fit_latency
from swarmwire.metrics.real.radio_fit.logs import loss_sequences, read_log
from tests.support.refusals import refused_input

HEAD = "t_s,tx,rx,seq,rssi_dbm,distance_m"
POSITIONS = "t_s,tx,rx,seq,rssi_dbm,tx_x_m,tx_y_m,rx_x_m,rx_y_m"


def log(path, *rows: str, head: str = HEAD):
    file = path / "log.csv"
    file.write_text("\n".join([head, *rows]) + "\n")
    return file


def test_gaps_are_packets_lost_at_even_times_and_links_are_apart(tmp_path):
    read = read_log(log(tmp_path, "0,b,a,7,-50,1", "1.0,a,b,1,-50,1", "2.5,a,b,4,-60,2", "1,b,a,8,,"))
    assert read.links == (("a", "b"), ("b", "a"))
    sequences = loss_sequences(read)
    assert sequences.link.tolist() == [0, 0, 0, 0, 1, 1]
    assert sequences.lost.tolist() == [False, True, True, False, False, True]
    assert sequences.since_s.tolist() == pytest.approx([np.inf, 0.5, 0.5, 0.5, np.inf, 1.0])
    assert sequences.burst_lengths.tolist() == [2, 1]


def test_runs_of_losses_do_not_go_on_from_link_to_link(tmp_path):
    read = read_log(log(tmp_path, "0,a,b,1,-50,1", "1,a,b,2,,", "0,b,a,1,,", "1,b,a,2,,", "2,b,a,3,-50,1"))
    assert loss_sequences(read).burst_lengths.tolist() == [1, 2]


def test_distance_is_that_of_the_positions(tmp_path):
    read = read_log(log(tmp_path, "0,a,b,1,-50,0,0,3,4", "1,a,b,2,,,,,", head=POSITIONS))
    assert read.distance_m[0] == pytest.approx(5.0)
    assert np.isnan(read.distance_m[1])


def test_parquet_says_what_csv_says(tmp_path):
    file = log(tmp_path, "0,a,b,1,-50.5,1", "1,a,b,4,,", "2,a,b,5,-60,2")
    pl.read_csv(file).write_parquet(tmp_path / "log.parquet")
    one, other = read_log(file), read_log(tmp_path / "log.parquet")
    assert one.links == other.links
    for name in ("time_s", "sequence", "rssi_dbm", "distance_m"):
        assert np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True)


def test_near_packets_of_a_link_that_went_away_in_between_are_two_links(tmp_path):
    rows = [f"{i},a,b,{i},-50,{distance}" for i, distance in enumerate([1, 2, 9, 9, 2, 1])]
    near = read_log(log(tmp_path, *rows, "0,b,a,1,-50,1")).within(5.0)
    assert near.links == (("a", "b"), ("a", "b"), ("b", "a"))
    assert near.sequence.tolist() == [0, 1, 4, 5, 1]
    assert not loss_sequences(near).lost.any()


def test_packets_lost_at_an_unknown_distance_were_where_the_last_known_was(tmp_path):
    rows = ["0,a,b,0,-50,1", "1,a,b,1,,", "2,a,b,2,-50,9", "3,a,b,3,,", "4,a,b,4,-50,1", "0,b,a,0,,", "1,b,a,1,-50,1"]
    read = read_log(log(tmp_path, *rows))
    assert read.last_distance_m == pytest.approx([1, 1, 9, 9, 1, np.nan, 1], nan_ok=True)
    assert read.within(5.0).sequence.tolist() == [0, 1, 4, 1]


@pytest.mark.parametrize(
    ("head", "rows", "key"),
    [
        ("t_s,tx,rx,seq", ["0,a,b,1"], "rssi_dbm"),
        ("t_s,tx,rx,seq,rssi_dbm", ["0,a,b,1,-50"], "distance_m"),
        (HEAD + ",tx_x_m", ["0,a,b,1,-50,1,0"], "tx_y_m"),
        (HEAD, [], ""),
        (HEAD, ["1,a,b,1,-50,1", "0,a,b,2,-50,1"], "row 2, t_s"),
        (HEAD, ["0,a,b,1,-50,1", "0,b,a,1,-50,1", "1,a,b,1,-50,1"], "row 3, seq"),
        (HEAD, ["0,a,b,2,-50,1", "1,a,b,1,-50,1"], "row 2, seq"),
        (HEAD, ["0,a,b,1,-50,1", "1,a,b,90000000,-50,1"], "row 2, seq"),
        (HEAD, ["0,a,b,1.5,-50,1"], "row 1, seq"),
        (HEAD, ["0,a,b,,-50,1"], "row 1, seq"),
        (HEAD, [",a,b,1,-50,1"], "row 1, t_s"),
        (HEAD, ["0,a,,1,-50,1"], "row 1, rx"),
        (HEAD, ["0,a,a,1,-50,1"], "row 1, rx"),
        (HEAD, ["0,a,b,1,strong,1"], "row 1, rssi_dbm"),
        (HEAD, ["0,a,b,1,inf,1"], "row 1, rssi_dbm"),
        (HEAD, ["0,a,b,1,-50,0"], "row 1, distance_m"),
        (HEAD, ["0,a,b,1,-50,"], "row 1, distance_m"),
        (POSITIONS, ["0,a,b,1,-50,0,0,,1"], "row 1, rx_x_m"),
        (POSITIONS, ["0,a,b,1,-50,2,3,2,3"], "row 1, rx_x_m"),
    ],
)
def test_log_of_packets_that_is_invalid_is_refused_with_row_and_column(tmp_path, head, rows, key):
    file = log(tmp_path, *rows, head=head)
    with refused_input(file, key):
        read_log(file)


@pytest.mark.parametrize(
    ("name", "text"), [("log.xls", ""), ("absent.csv", None), ("empty.csv", ""), ("log.parquet", "no parquet")]
)
def test_file_that_is_no_table_is_refused_in_one_line_by_a_fit(tmp_path, name, text):
    if text is not None:
        (tmp_path / name).write_text(text)
    with refused_input(tmp_path / name):
        read_log(tmp_path / name)


PACKETS = 20_000


def made(delays: Delays, constant_s: float = 0.0) -> np.ndarray:
    """Latencies as the emulator's radio draws them."""
    law, draws = delay_distribution(delays), np.random.default_rng(5).uniform(0.0, 1.0, PACKETS)
    return constant_s + np.array([varying_delay_ns(law, u) for u in draws]) / NS_PER_S


@pytest.mark.parametrize("distribution", ["normal", "lognormal", "pareto"])
def test_delay_distributions_are_identified_and_their_parameters_recovered(distribution):
    fit = fit_latency(made(Delays(distribution, 0.02, 0.006)))
    assert isinstance(fit, LatencyFit)
    assert fit.delays is not None
    assert fit.delays.distribution == distribution
    assert fit.delays.ks_distance < 0.02 < fit.ks_distance
    # A constant and what varies are told apart less well than their sum.
    assert fit.delays.latency_s.value + fit.delays.mean_s.value == pytest.approx(0.02, rel=0.03)
    assert fit.delays.deviation_s.value == pytest.approx(0.006, rel=0.15)
    assert 0.0 < fit.delays.mean_s.standard_error < 0.004


def test_constant_below_a_skewed_delay_is_recovered():
    fit = fit_delays(made(Delays("lognormal", 0.01, 0.01), constant_s=0.05))
    assert fit is not None
    assert fit.distribution == "lognormal"
    assert fit.latency_s.value == pytest.approx(0.05, abs=0.001)
    assert fit.mean_s.value == pytest.approx(0.01, rel=0.05)


def test_made_again_of_its_fit_a_gamma_delay_has_the_same_quantiles():
    """None of the distributions is a gamma one: the nearest of them stands for it."""
    latency_s = np.random.default_rng(6).gamma(2.0, 0.005, PACKETS) + 0.002
    fit = fit_latency(latency_s)
    assert isinstance(fit, LatencyFit)
    delays = fit.delays
    assert delays is not None
    again_s = made(Delays(delays.distribution, delays.mean_s.value, delays.deviation_s.value), delays.latency_s.value)
    for percent in (10.0, 50.0, 90.0):
        assert np.percentile(again_s, percent) == pytest.approx(np.percentile(latency_s, percent), rel=0.05)


def test_uniform_delays_stay_uniform():
    fit = fit_latency(made(Delays("uniform", 0.02, 0.005)))
    assert isinstance(fit, LatencyFit)
    assert fit.delays is None


def test_few_very_late_packets_make_no_other_distribution():
    latency_s = made(Delays("uniform", 0.02, 0.005))
    latency_s[::40] += 2.0
    fit = fit_latency(latency_s)
    assert isinstance(fit, LatencyFit)
    assert fit.delays is None

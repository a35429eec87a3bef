"""Measured link matrices are read by the robots' names, or refused in one line."""

import numpy as np
import polars as pl
import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.radio.link_trace_file import read_link_traces

ROBOTS = ("flock-0", "flock-1", "flock-2")
HEAD = "t_s,tx,rx,delivery_ratio"


def test_csv_and_parquet_are_read_by_name(tmp_path):
    file = tmp_path / "trace.csv"
    file.write_text(f"{HEAD}\n0,flock-2,flock-0,0.25\n0.5,flock-2,flock-0,1\n")
    pl.read_csv(file).write_parquet(tmp_path / "trace.parquet")
    for path in (file, tmp_path / "trace.parquet"):
        traces = read_link_traces(path, ROBOTS)
        assert traces.rssi_dbm is None
        assert traces.delay_s is None
        trace = traces.delivery_ratio
        assert trace is not None
        found = trace.at(np.array([2, 2, 0]), np.array([0, 0, 2]), np.array([499_999_999, 500_000_000, 500_000_000]))
        assert found == pytest.approx([0.25, 1.0, np.nan], nan_ok=True)


def test_each_quantity_has_the_rows_that_give_it_a_value(tmp_path):
    file = tmp_path / "trace.csv"
    file.write_text("t_s,tx,rx,delay_s,rssi_dbm\n0,flock-0,flock-1,0.5,\n1,flock-0,flock-1,,-60\n")
    traces = read_link_traces(file, ROBOTS)
    assert traces.delivery_ratio is None
    sender, receiver, at_ns = np.array([0, 0, 1]), np.array([1, 1, 0]), np.array([0, 10**9, 10**9])
    for trace, expected in ((traces.delay_s, [0.5, 0.5, np.nan]), (traces.rssi_dbm, [np.nan, -60.0, np.nan])):
        assert trace is not None
        assert trace.at(sender, receiver, at_ns) == pytest.approx(expected, nan_ok=True)
    assert traces.known(sender, receiver, at_ns).tolist() == [True, True, False]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("t_s,tx,delay_s\n0,flock-0,1\n", "rx: is missing; the file has t_s, tx, delay_s"),
        (
            "t_s,tx,rx\n0,flock-0,flock-1\n",
            "expected at least one of the columns delivery_ratio, rssi_dbm, delay_s, got none",
        ),
        (
            "t_s,tx,rx,rssi_dbm,delay_s\n0,flock-0,flock-1,-50,\n1,flock-0,flock-1,,\n",
            "row 2, rssi_dbm or delay_s: expected a value",
        ),
        (
            "t_s,tx,rx,rssi_dbm,delay_s\n0,flock-0,flock-1,-50,\n0,flock-0,flock-1,,0.1\n1,flock-0,flock-1,,-1\n",
            "row 3, delay_s: expected at least 0 s",
        ),
        (
            f"{HEAD}\n0,flock-0,flock-1,1\n0,flock-0,flock-9,1\n",
            "row 2, rx: expected a robot of the scenario, flock-0 … flock-2, got flock-9",
        ),
        (f"{HEAD}\n0,flock-0,flock-1,1.5\n", "row 1, delivery_ratio: expected a ratio from 0 to 1"),
        (f"{HEAD}\n0,flock-0,flock-1,\n", "row 1, delivery_ratio: expected a value"),
        (f"{HEAD}\n,flock-0,flock-1,1\n", "row 1, t_s: expected a time in s"),
        (
            f"{HEAD}\n1,flock-0,flock-1,1\n0,flock-0,flock-1,1\n",
            "row 2, t_s: does not rise on this link; expected its rows in the order of time",
        ),
    ],
)
def test_what_cannot_be_is_refused_by_row_and_column(tmp_path, text, told):
    file = tmp_path / "trace.csv"
    file.write_text(text)
    with pytest.raises(BadInput) as error:
        read_link_traces(file, ROBOTS)
    assert str(error.value) == f"{file}: {told}"

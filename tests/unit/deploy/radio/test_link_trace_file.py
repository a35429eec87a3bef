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


PAIR = "flock-0,flock-1"
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
def test_what_cannot_be_is_refused_by_row_and_column(tmp_path, text, key):
    file = tmp_path / "trace.csv"
    file.write_text(text)
    with pytest.raises(BadInput) as error:
        read_link_traces(file, ROBOTS)
    assert (error.value.where, error.value.key) == (str(file), key)

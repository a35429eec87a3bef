"""Logs of robots' radios, read from CSV or Parquet and refused at the door."""

from pathlib import Path

import numpy as np

from swarmwire.comms.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.metrics.radio_fit.radio_log import RadioLog
from swarmwire.metrics.table_file import MeasuredTable

NEEDED = ("t_s", "tx", "rx", "seq", "rssi_dbm")
ENDS = ("tx_x_m", "tx_y_m", "rx_x_m", "rx_y_m")
DISTANCE = "distance_m"
MAX_LOST = 10_000_000


def read_log(path: Path) -> RadioLog:
    """The log in a file, its links in the order of their names.

    Columns: t_s, tx, rx, seq, rssi_dbm (empty: the packet was lost), and tx_x_m, tx_y_m, rx_x_m, rx_y_m or distance_m
    (may be empty where a packet was lost). The rows of a link stand in the order of time, links in any.
    BadInput where they do not, for a sequence number that comes twice, and for values that cannot be.
    """
    table = MeasuredTable(path)
    table.need(NEEDED)
    time_s, sequence, rssi_dbm = (table.numbers(name) for name in ("t_s", "seq", "rssi_dbm"))
    table.refuse_where(np.isnan(time_s), "t_s", "expected a time in s")
    table.refuse_where(~(np.abs(sequence) < 2.0**53) | (sequence % 1 != 0), "seq", "expected a whole number")
    names = list(zip(table.texts("tx"), table.texts("rx"), strict=True))
    table.refuse_where(np.array([tx == rx for tx, rx in names]), "rx", "expected another robot than tx")
    lost = np.isnan(rssi_dbm)
    ends_m = _ends(table, lost)
    distance_m = _distance(table, ends_m, lost)
    links = tuple(sorted(set(names)))
    place = {link: i for i, link in enumerate(links)}
    link = np.array([place[name] for name in names], np.int64)
    order: IntArray = np.argsort(link, kind="stable")
    _refuse_disorder(table, order, link, time_s, sequence)
    whole = sequence.astype(np.int64)
    ends = None if ends_m is None else ends_m[order]
    return RadioLog(links, link[order], time_s[order], whole[order], rssi_dbm[order], distance_m[order], ends)


def _ends(table: MeasuredTable, lost: BoolArray) -> FloatArray | None:
    """Positions (rows, 4) of sender and receiver in m, if the file has them."""
    if not any(name in table.columns for name in ENDS):
        return None
    table.need(ENDS)
    for name in ENDS:
        table.refuse_where(np.isnan(table.numbers(name)) & ~lost, name, "expected the position of a received packet")
    return np.stack([table.numbers(name) for name in ENDS], axis=1)


def _distance(table: MeasuredTable, ends_m: FloatArray | None, lost: BoolArray) -> FloatArray:
    """Distance of sender and receiver in m, (rows,): of the positions, if there are any."""
    if ends_m is not None:
        apart_m: FloatArray = np.hypot(ends_m[:, 2] - ends_m[:, 0], ends_m[:, 3] - ends_m[:, 1])
        table.refuse_where(apart_m <= 0.0, "rx_x_m", "expected sender and receiver in different places")
        return apart_m
    if DISTANCE not in table.columns:
        raise table.refused(DISTANCE, f"is missing, and so are the positions {', '.join(ENDS)}; expected either")
    distance_m = table.numbers(DISTANCE)
    table.refuse_where((np.isnan(distance_m) & ~lost) | (distance_m <= 0.0), DISTANCE, "expected more than 0 m")
    return distance_m


def _refuse_disorder(
    table: MeasuredTable, order: IntArray, link: IntArray, time_s: FloatArray, sequence: FloatArray
) -> None:
    """BadInput unless time and sequence number rise from row to row of each link."""
    same = np.diff(link[order]) == 0
    steps = np.diff(sequence[order])
    for wrong, column, expected in (
        (steps == 0, "seq", "comes twice on this link; expected each number once"),
        (steps < 0, "seq", "falls on this link; expected numbers that rise with time"),
        (np.diff(time_s[order]) <= 0, "t_s", "does not rise on this link; expected its rows in the order of time"),
    ):
        table.refuse_where(_rows(order, same & wrong), column, expected)
    gaps = np.where(same, steps - 1.0, 0.0)
    if gaps.sum() > MAX_LOST:
        widest = _rows(order, gaps == gaps.max())
        table.refuse_where(
            widest, "seq", f"leaves {gaps.max():.0f} packets out; expected {MAX_LOST} lost in all at most"
        )


def _rows(order: IntArray, wrong: AnyArray) -> BoolArray:
    """Rows of the file, (rows,), from steps between rows in order, (rows - 1,)."""
    found = np.zeros(len(order), np.bool_)
    found[order[1:][wrong]] = True
    return found

"""Measured link matrices, read from CSV or Parquet for the air to replay."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from swarmwire.comms.air.trace.link_trace import POSSIBLE, LinkTrace, Quantity, RefusedRow, link_trace
from swarmwire.comms.arrays import IntArray
from swarmwire.comms.clock import NS_PER_S
from swarmwire.metrics.measured_table import MeasuredTable

LONGEST_S = 1e9  # whose nanoseconds fit an integer
COLUMNS = {"time": "t_s", "sender": "tx", "receiver": "rx"}


def read_link_trace(path: Path, robots: Sequence[str]) -> LinkTrace:
    """The trace in a file, for robots with these names in the order of their index in the arena.

    Columns: t_s, since the start of the run; tx and rx, names of robots; and one of delivery_ratio, rssi_dbm, delay_s.
    BadInput for unknown robots, times that do not rise on a link, and values that cannot be.
    """
    table = MeasuredTable(path)
    table.need(tuple(COLUMNS.values()))
    measured: list[Quantity] = [name for name in POSSIBLE if name in table.columns]
    if len(measured) != 1:
        found = " and ".join(measured) or "none"
        raise table.refused("", f"expected one of the columns {', '.join(POSSIBLE)}, got {found}")
    quantity = measured[0]
    time_s = table.numbers("t_s")
    table.refuse_where(~(np.abs(time_s) < LONGEST_S), "t_s", "expected a time in s")
    time_ns = np.round(time_s * NS_PER_S).astype(np.int64)
    sender, receiver = (_index(table, column, robots) for column in ("tx", "rx"))
    try:
        return link_trace(quantity, len(robots), time_ns, sender, receiver, table.numbers(quantity))
    except RefusedRow as refused:
        column = COLUMNS.get(refused.column, quantity)
        raise table.refused(f"row {refused.row + 1}, {column}", refused.expected) from None


def _index(table: MeasuredTable, column: str, robots: Sequence[str]) -> IntArray:
    place = {name: i for i, name in enumerate(robots)}
    names = table.texts(column)
    index = np.array([place.get(name, -1) for name in names], np.int64)
    if (index < 0).any():
        unknown = names[int(np.argmax(index < 0))]
        first, last = (robots[0], robots[-1]) if robots else ("", "")
        table.refuse_where(index < 0, column, f"expected a robot of the scenario, {first} … {last}, got {unknown}")
    return index

"""Measured links, read from CSV or Parquet for the medium to replay."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.errors import BadInput
from swarmwire.comms.radio.traces import POSSIBLE, LinkTrace, LinkTraces, Quantity, RefusedRow, link_trace
from swarmwire.metrics.table_file import MeasuredTable
from swarmwire.world.scenario.scenario import Scenario

MAX_S = 1e9  # whose nanoseconds fit an integer
COLUMNS = {"time": "t_s", "sender": "tx", "receiver": "rx"}


def scenario_traces(scenario: Scenario) -> LinkTraces | None:
    """What the file of the scenario's `[radio.trace]` holds; None without one. BadInput if it cannot be replayed."""
    path = trace_path(scenario)
    if path is None:
        return None
    if not path.is_file():
        raise BadInput(scenario.source, "radio.trace.file", f"expected a file beside the scenario: there is no {path}")
    traces = read_link_traces(path, scenario.robot_names())
    if traces.rssi_dbm is not None and scenario.radio is not None and not scenario.radio.is_phy:
        raise BadInput(str(path), "rssi_dbm", "expected a radio with a PHY: a disk knows no strength")
    return traces


def trace_path(scenario: Scenario) -> Path | None:
    """Where the file of the scenario's `[radio.trace]` is; None without one."""
    trace = scenario.radio.trace if scenario.radio else None
    return (Path(scenario.source).parent / trace.file).resolve() if trace else None


def read_link_traces(path: Path, robots: Sequence[str]) -> LinkTraces:
    """The traces in a file, for robots with these names in the order of their index in the arena.

    Columns: t_s, since the start of the run; tx and rx, names of robots; and at least one of delivery_ratio, rssi_dbm,
    delay_s, of which each row has one or more. BadInput for unknown robots, times that do not rise on a link, and
    values that cannot be.
    """
    table = MeasuredTable(path)
    table.need(tuple(COLUMNS.values()))
    measured: list[Quantity] = [name for name in POSSIBLE if name in table.columns]
    if not measured:
        raise table.refused("", f"expected at least one of the columns {', '.join(POSSIBLE)}, got none")
    time_s = table.numbers("t_s")
    table.refuse_where(~(np.abs(time_s) < MAX_S), "t_s", "expected a time in s")
    time_ns = np.round(time_s * NS_PER_S).astype(np.int64)
    sender, receiver = (_index(table, column, robots) for column in ("tx", "rx"))
    values: dict[Quantity, FloatArray] = {quantity: table.numbers(quantity) for quantity in measured}
    nothing = np.all([np.isnan(value) for value in values.values()], axis=0)
    table.refuse_where(nothing, " or ".join(measured), "expected a value")
    return LinkTraces(
        **{
            quantity: _trace(table, quantity, len(robots), time_ns, sender, receiver, value)
            for quantity, value in values.items()
            if not np.isnan(value).all()
        }
    )


def _trace(
    table: MeasuredTable,
    quantity: Quantity,
    robots: int,
    time_ns: IntArray,
    sender: IntArray,
    receiver: IntArray,
    value: FloatArray,
) -> LinkTrace:
    """The trace of the rows that have a value of this quantity."""
    rows = np.flatnonzero(~np.isnan(value))
    try:
        return link_trace(quantity, robots, time_ns[rows], sender[rows], receiver[rows], value[rows])
    except RefusedRow as refused:
        column = COLUMNS.get(refused.column, quantity)
        raise table.refused(f"row {rows[refused.row] + 1}, {column}", refused.expected) from None


def _index(table: MeasuredTable, column: str, robots: Sequence[str]) -> IntArray:
    place = {name: i for i, name in enumerate(robots)}
    names = table.texts(column)
    index = np.array([place.get(name, -1) for name in names], np.int64)
    if (index < 0).any():
        unknown = names[int(np.argmax(index < 0))]
        first, last = (robots[0], robots[-1]) if robots else ("", "")
        table.refuse_where(index < 0, column, f"expected a robot of the scenario, {first} … {last}, got {unknown}")
    return index

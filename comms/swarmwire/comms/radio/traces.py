"""Link traces: measured delivery ratio, RSSI or delay of each directed link over time."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.kernels import kernel, njit

Quantity = Literal["delivery_ratio", "rssi_dbm", "delay_s"]  # measured quantities
NEVER_NS = 2**63 - 1
MAX_DBM = 1000.0  # largest absolute value of a measured RSSI, whose power in mW is a finite number
MAX_DELAY_S = 1e9  # its nanoseconds, added to a time of a run, fit an integer


class TraceValues(NamedTuple):
    """Values of directed links over time, as input of kernels; see `LinkTrace`."""

    link: IntArray  # (links,)
    start: IntArray  # (links + 1,)
    time_ns: IntArray  # (values,)
    value: FloatArray  # (values,)


NO_VALUES = TraceValues(np.empty(0, np.int64), np.zeros(1, np.int64), np.empty(0, np.int64), np.empty(0))
RATIO, DELAY, FIRST = range(3)  # quantities in `LinkTraces.values`


@kernel()
def value_at(values: Any, link: Any, at_ns: int):
    """Return the value of a link at a time; NaN before its first one and for links without values."""
    row = _first_above(values.link, 0, len(values.link), link) - 1
    if row < 0 or values.link[row] != link:
        return np.nan
    first = values.start[row]
    latest = _first_above(values.time_ns, first, values.start[row + 1], at_ns) - 1
    return values.value[latest] if latest >= first else np.nan


@kernel()
def _first_above(numbers: AnyArray, low: Any, high: Any, number: Any):
    """Return the first index from `low` to `high` whose number is above `number`, by bisection; else `high`."""
    while low < high:
        middle = (low + high) // 2
        if numbers[middle] > number:
            high = middle
        else:
            low = middle + 1
    return low


@njit()
def _values_at(values: Any, link: AnyArray, at_ns: AnyArray):
    out = np.empty(len(link))
    for i in range(len(link)):
        out[i] = value_at(values, link[i], at_ns[i])
    return out


@dataclass(frozen=True, eq=False)
class LinkTrace:
    """Measured values of directed links; each value holds until the link's next one. Sparse, links in rising order.

    Link i leads from robot `link[i] // robots` to `link[i] % robots`; its values are those from start[i] to
    start[i + 1].
    """

    quantity: Quantity
    robots: int
    link: IntArray  # (links,) sender x robots + receiver, as indices in the arena; rising
    start: IntArray  # (links + 1,)
    time_ns: IntArray  # (values,) since the start of the run; rising within a link
    value: FloatArray  # (values,) probability, dBm or s by quantity

    def values_at(self, sender: IntArray, receiver: IntArray, at_ns: IntArray) -> FloatArray:
        """Return the value of each link (k,) at a time, NaN before its first and for links that were never measured.

        Sender and receiver are indices in the arena. About 0.5 us each, for random links among ten thousand.
        """
        return _values_at(self.values, sender * self.robots + receiver, at_ns)

    @property
    def values(self) -> TraceValues:
        """Return the values as input of kernels."""
        return TraceValues(self.link, self.start, self.time_ns, self.value)


class RefusedRow(ValueError):
    """An invalid measured row: its index, the column (time, sender, receiver or value) and the reason."""

    def __init__(self, row: int, column: str, expected: str) -> None:
        self.row, self.column, self.expected = row, column, expected
        super().__init__(f"row {row}, {column}: {expected}")


def link_trace(
    quantity: Quantity, robots: int, time_ns: IntArray, sender: IntArray, receiver: IntArray, value: FloatArray
) -> LinkTrace:
    """Return the trace of measured rows (n,): rows of a link in the order of time, links in any order.

    `RefusedRow` names the first row whose sender or receiver is not one of the `robots`, whose time does not rise on
    its link, or whose value is invalid: a ratio must be within 0 and 1, an RSSI within +-1000 dBm, a delay within 0
    and 1e9 s.
    """
    for column, index in (("sender", sender), ("receiver", receiver)):
        _refuse((index < 0) | (index >= robots), column, "is not one of the robots")
    _refuse(sender == receiver, "receiver", "is the sender itself; expected another robot")
    possible, expected = POSSIBLE[quantity]
    _refuse(~(np.isfinite(value) & possible(value)), "value", expected)
    link = sender * robots + receiver
    order = np.argsort(link, kind="stable")
    same_link, falls = np.diff(link[order]) == 0, np.diff(time_ns[order]) <= 0
    is_invalid = np.zeros(len(link), np.bool_)
    is_invalid[order[1:][same_link & falls]] = True
    _refuse(is_invalid, "time", "does not rise on this link; expected its rows in the order of time")
    links, first = np.unique(link[order], return_index=True)
    start = np.append(first, len(link)).astype(np.int64)
    return LinkTrace(quantity, robots, links.astype(np.int64), start, time_ns[order], value[order])


# Test of a quantity's valid values, and the text of the error.
Possible = Callable[[FloatArray], AnyArray]
POSSIBLE: dict[Quantity, tuple[Possible, str]] = {
    "delivery_ratio": (lambda value: (value >= 0.0) & (value <= 1.0), "expected a ratio from 0 to 1"),
    "rssi_dbm": (lambda value: np.abs(value) <= MAX_DBM, f"expected -{MAX_DBM:g} to {MAX_DBM:g} dBm"),
    "delay_s": (lambda value: (value >= 0.0) & (value <= MAX_DELAY_S), f"expected 0 to {MAX_DELAY_S:g} s"),
}


def _refuse(is_invalid: AnyArray, column: str, expected: str) -> None:
    if is_invalid.any():
        raise RefusedRow(int(np.argmax(is_invalid)), column, expected)


@dataclass(frozen=True, eq=False)
class LinkTraces:
    """The traces of one file, a trace per quantity; None: not measured."""

    delivery_ratio: LinkTrace | None = None
    rssi_dbm: LinkTrace | None = None
    delay_s: LinkTrace | None = None

    @property
    def all(self) -> tuple[LinkTrace, ...]:
        """The traces of the quantities that were measured."""
        traces = self.delivery_ratio, self.rssi_dbm, self.delay_s
        return tuple(trace for trace in traces if trace is not None)

    @cached_property
    def first_values(self) -> TraceValues:
        """Values of 1 for each link from the time of its first value of any quantity on."""
        if not self.all:
            return NO_VALUES
        link = np.unique(np.concatenate([trace.link for trace in self.all]))
        time_ns = np.full(len(link), NEVER_NS)
        for trace in self.all:
            rows = np.searchsorted(link, trace.link)
            time_ns[rows] = np.minimum(time_ns[rows], trace.time_ns[trace.start[:-1]])
        return TraceValues(link, np.arange(len(link) + 1), time_ns, np.ones(len(link)))

    @cached_property
    def values(self) -> TraceValues:
        """RATIO, DELAY and FIRST (`first_values`) in one: link i of quantity q is link q x robots x robots + i."""
        traces = self.delivery_ratio, self.delay_s
        parts = *(NO_VALUES if trace is None else trace.values for trace in traces), self.first_values
        robots = max((trace.robots for trace in self.all), default=0)
        first = np.cumsum([0, *(len(part.value) for part in parts)]).tolist()
        return TraceValues(
            np.concatenate([quantity * robots * robots + part.link for quantity, part in enumerate(parts)]),
            np.concatenate([*(k + part.start[:-1] for k, part in zip(first, parts, strict=False)), first[-1:]]),
            np.concatenate([part.time_ns for part in parts]),
            np.concatenate([part.value for part in parts]),
        )

    def has_values(self, sender: IntArray, receiver: IntArray, at_ns: IntArray) -> BoolArray:
        """Return True for each link (k,), indices in the arena, that has a value of any quantity at `at_ns`."""
        robots = max((trace.robots for trace in self.all), default=0)
        return ~np.isnan(_values_at(self.first_values, sender * robots + receiver, at_ns))

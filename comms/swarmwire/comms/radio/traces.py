"""Link traces: what was measured of each directed link over time, and what it was at a moment."""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numba import njit

from swarmwire.comms.arrays import AnyArray, BoolArray, FloatArray, IntArray

Quantity = Literal["delivery_ratio", "rssi_dbm", "delay_s"]  # what may be measured


@dataclass(frozen=True, eq=False)
class LinkTrace:
    """Measured values of directed links, each of which holds until the link's next; sparse, links in rising order.

    Link i leads from robot `link[i] // robots` to `link[i] % robots`; its values are those from start[i] to
    start[i + 1].
    """

    quantity: Quantity
    robots: int
    link: IntArray  # (links,) sender x robots + receiver, as indices in the arena; rising
    start: IntArray  # (links + 1,)
    time_ns: IntArray  # (values,) since the start of the run; rising within a link
    value: FloatArray  # (values,) probability, dBm or s by quantity

    def at(self, sender: IntArray, receiver: IntArray, at_ns: IntArray) -> FloatArray:
        """The value of each link (k,) at a time, NaN before its first and for links that were never measured.

        Sender and receiver are indices in the arena. About 0.5 us each, for random links among ten thousand.
        """
        return _at(self.link, self.start, self.time_ns, self.value, sender * self.robots + receiver, at_ns)


class RefusedRow(ValueError):
    """A measured row that cannot be: which, in which of the columns time, sender, receiver, value, and why."""

    def __init__(self, row: int, column: str, expected: str) -> None:
        self.row, self.column, self.expected = row, column, expected
        super().__init__(f"row {row}, {column}: {expected}")


def link_trace(
    quantity: Quantity, robots: int, time_ns: IntArray, sender: IntArray, receiver: IntArray, value: FloatArray
) -> LinkTrace:
    """The trace from measured rows (n,), those of a link in the order of time, links in any.

    `RefusedRow` names the first row whose sender or receiver is not one of so many robots, whose time does not rise on
    its link, or whose value cannot be: a ratio within 0 and 1, an RSSI finite, a delay finite and at least 0.
    """
    for column, index in (("sender", sender), ("receiver", receiver)):
        _refuse((index < 0) | (index >= robots), column, "is not one of the robots")
    _refuse(sender == receiver, "receiver", "is the sender itself; expected another robot")
    possible, expected = POSSIBLE[quantity]
    _refuse(~(np.isfinite(value) & possible(value)), "value", expected)
    link = sender * robots + receiver
    order = np.argsort(link, kind="stable")
    same, falls = np.diff(link[order]) == 0, np.diff(time_ns[order]) <= 0
    wrong = np.zeros(len(link), np.bool_)
    wrong[order[1:][same & falls]] = True
    _refuse(wrong, "time", "does not rise on this link; expected its rows in the order of time")
    links, first = np.unique(link[order], return_index=True)
    start = np.append(first, len(link)).astype(np.int64)
    return LinkTrace(quantity, robots, links.astype(np.int64), start, time_ns[order], value[order])


# What can be measured: which values are possible, and how to say so.
Possible = Callable[[FloatArray], AnyArray]
POSSIBLE: dict[Quantity, tuple[Possible, str]] = {
    "delivery_ratio": (lambda value: (value >= 0.0) & (value <= 1.0), "expected a ratio from 0 to 1"),
    "rssi_dbm": (np.isfinite, "expected a number of dBm"),
    "delay_s": (lambda value: value >= 0.0, "expected at least 0 s"),
}


def _refuse(wrong: AnyArray, column: str, expected: str) -> None:
    if wrong.any():
        raise RefusedRow(int(np.argmax(wrong)), column, expected)


@njit(cache=True)
def _at(links, start, time_ns, value, link, at_ns):
    found = np.full(len(link), np.nan)
    for i in range(len(link)):
        place = np.searchsorted(links, link[i])
        if place < len(links) and links[place] == link[i]:
            first, stop = start[place], start[place + 1]
            before = first + np.searchsorted(time_ns[first:stop], at_ns[i], side="right") - 1
            if before >= first:
                found[i] = value[before]
    return found


# --- The traces of one file: what was measured of the same links, each quantity with its own rows.


@dataclass(frozen=True, eq=False)
class LinkTraces:
    """Measured links by quantity; None: not measured at all."""

    delivery_ratio: LinkTrace | None = None
    rssi_dbm: LinkTrace | None = None
    delay_s: LinkTrace | None = None

    @property
    def all(self) -> tuple[LinkTrace, ...]:
        """Those that were measured."""
        traces = self.delivery_ratio, self.rssi_dbm, self.delay_s
        return tuple(trace for trace in traces if trace is not None)

    def known(self, sender: IntArray, receiver: IntArray, at_ns: IntArray) -> BoolArray:
        """Which links (k,), indices in the arena, have a value of any quantity at a time."""
        found = np.zeros(len(sender), np.bool_)
        for trace in self.all:
            found |= ~np.isnan(trace.at(sender, receiver, at_ns))
        return found

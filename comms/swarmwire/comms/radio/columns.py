"""Columns of whole numbers in one array: tables of packets and links cross into compiled code as one argument.

An argument costs a call from Python as much as some ten rows cost the kernel, and a tick of ten robots is mostly calls.
"""

from typing import Protocol

from swarmwire.comms.arrays import IntArray


class Tabled(Protocol):
    """An object with columns."""

    table: IntArray  # (columns, k)


class Column:
    """A named column of a `table`, (k,): a view, which may be written to."""

    def __init__(self, place: int) -> None:
        self._place = place

    def __get__(self, of: Tabled, owner: object = None) -> IntArray:
        return of.table[self._place]

"""Rich's console for colours, and tables as wide as the terminal; every text is made printable."""

import os
from collections.abc import Iterable, Sequence
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from swarmwire.comms.base.printable import LINES, printable

UNWRAPPED = 10_000  # columns
Row = Sequence[str]


class TerminalConsole(Console):
    """A console with printable texts and without markup: only styles set colours and positions."""

    def __init__(self, **options: Any) -> None:
        super().__init__(highlight=False, markup=False, **options)
        if not self.is_terminal and "width" not in options and "COLUMNS" not in os.environ:
            self.width = UNWRAPPED  # rich's default of 80 would break lines that programs read

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Return rich's segments with printable texts."""
        for text, style, control in super().render(renderable, options):
            yield Segment(text if control else printable(text, keep=LINES), style, control)


def print_rows(columns: Row, rows: Sequence[Row], console: Console, *, blank_line: bool = False) -> None:
    """Print rows under headings, in a pipe as plain lines; a repeated value of the first column is left out.

    With `blank_line` an empty line follows plain lines.
    """
    if console.is_terminal:
        console.print(_table(columns, rows))
        return
    for line in aligned([columns, *rows]):
        console.print(Text(line), soft_wrap=True)
    if blank_line:
        console.print()


def aligned(rows: Sequence[Row]) -> list[str]:
    """Return a line for each row, with aligned columns.

    >>> aligned([("robot", "state"), ("flock-10", "ok")])
    ['robot     state', 'flock-10  ok']
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def _table(columns: Row, rows: Sequence[Row]) -> Table:
    table = Table(box=None, header_style="dim", pad_edge=False, padding=(0, 2, 0, 0))
    for index, heading in enumerate(columns):
        table.add_column(Text(heading), style="cyan" if index == 0 else "", overflow="fold")
    for previous, row in zip([("",), *rows], rows, strict=False):
        table.add_row(*map(Text, ("" if row[0] == previous[0] else row[0], *row[1:])))
    return table

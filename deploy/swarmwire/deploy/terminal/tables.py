"""Tables on the terminal: as wide as it is, or plain lines of aligned columns where they are piped."""

from collections.abc import Sequence

from rich.console import Console
from rich.table import Table
from rich.text import Text

Row = Sequence[str]


def print_rows(columns: Row, rows: Sequence[Row], console: Console, *, gap: bool = False) -> None:
    """Rows under headings; what stands in the first column is said once. With `gap` more follows plain lines."""
    if console.is_terminal:
        console.print(_table(columns, rows))
        return
    for line in aligned([columns, *rows]):
        console.print(Text(line), soft_wrap=True)
    if gap:
        console.print()


def aligned(rows: Sequence[Row]) -> list[str]:
    """A line for each row, whose columns stand below one another.

    >>> aligned([("robot", "state"), ("flock-10", "ok")])
    ['robot     state', 'flock-10  ok']
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def _table(columns: Row, rows: Sequence[Row]) -> Table:
    table = Table(box=None, header_style="dim", pad_edge=False, padding=(0, 2, 0, 0))
    for place, heading in enumerate(columns):
        table.add_column(Text(heading), style="cyan" if place == 0 else "", overflow="fold")
    for before, row in zip([("",), *rows], rows, strict=False):
        table.add_row(*map(Text, ("" if row[0] == before[0] else row[0], *row[1:])))
    return table

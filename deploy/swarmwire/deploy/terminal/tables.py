"""Tables as wide as the terminal, or plain lines of aligned columns in a pipe."""

from collections.abc import Sequence

from rich.console import Console
from rich.table import Table
from rich.text import Text

Row = Sequence[str]


def print_rows(columns: Row, rows: Sequence[Row], console: Console, *, blank_line: bool = False) -> None:
    """Print rows under headings; a repeated value of the first column is left out.

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

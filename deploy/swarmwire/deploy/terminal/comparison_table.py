"""A comparison on the terminal: a table as wide as that is, plain lines of aligned columns where it is piped."""

from rich.console import Console
from rich.table import Table
from rich.text import Text

from swarmwire.metrics.campaign.comparison import Comparison
from swarmwire.metrics.campaign.comparison_texts import COLUMNS, cells, notes


def print_comparison(comparison: Comparison, console: Console) -> None:
    """The rows, then what they mean."""
    rows = [cells(comparison, row) for row in comparison.rows]
    if console.is_terminal:
        console.print(_table(rows))
    else:
        _print_plain(rows, console)
    for note in notes(comparison):
        console.print(Text(note, "dim"), soft_wrap=not console.is_terminal)


def _table(rows: list[tuple[str, ...]]) -> Table:
    table = Table(box=None, header_style="dim", pad_edge=False, padding=(0, 2, 0, 0))
    for place, heading in enumerate(COLUMNS):
        table.add_column(Text(heading), style="cyan" if place == 0 else "", overflow="fold")
    for before, row in zip([("",), *rows], rows, strict=False):
        table.add_row(*map(Text, ("" if row[0] == before[0] else row[0], *row[1:])))
    return table


def _print_plain(rows: list[tuple[str, ...]], console: Console) -> None:
    whole = [COLUMNS, *rows]
    widths = [max(map(len, column)) for column in zip(*whole, strict=True)]
    for row in whole:
        line = "  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True))
        console.print(Text(line.rstrip()), soft_wrap=True)
    console.print()

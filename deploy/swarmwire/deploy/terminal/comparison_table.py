"""A comparison on the terminal: its rows, and what they mean."""

from rich.console import Console
from rich.text import Text

from swarmwire.deploy.terminal.rows import print_rows
from swarmwire.metrics.campaign.comparison import Comparison
from swarmwire.metrics.campaign.comparison_texts import COLUMNS, cells, notes


def print_comparison(comparison: Comparison, console: Console) -> None:
    """The rows, then what they mean."""
    print_rows(COLUMNS, [cells(comparison, row) for row in comparison.rows], console, gap=True)
    for note in notes(comparison):
        console.print(Text(note, "dim"), soft_wrap=not console.is_terminal)

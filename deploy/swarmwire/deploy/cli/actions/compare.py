"""`swarmwire compare`: two campaigns at their common design points."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.text import Text

from swarmwire.deploy.terminal.console import TerminalConsole, print_rows
from swarmwire.deploy.terminal.output import echo
from swarmwire.metrics.records.campaign.compare import (
    COLUMNS,
    CampaignComparison,
    cells,
    compare,
    notes,
    write_comparison,
)
from swarmwire.metrics.records.campaign.folder import select


def compare_campaigns(a: str, b: str, responses: Sequence[str], file: Path | None) -> None:
    """Compare two campaigns, print the comparison, and write it to a file if there is one."""
    comparison = compare(select(a), select(b), responses)
    print_comparison(comparison, TerminalConsole())
    if file is not None:
        write_comparison(comparison, file)
        echo(f"written: {file}")


def print_comparison(comparison: CampaignComparison, console: Console) -> None:
    """Print the rows of a comparison of campaigns, then notes on their meaning."""
    print_rows(COLUMNS, [cells(comparison, row) for row in comparison.rows], console, blank_line=True)
    for note in notes(comparison):
        console.print(Text(note, "dim"), soft_wrap=not console.is_terminal)

"""A sim-to-real comparison on the terminal: the verdict, what differs beforehand, and the tables, the worst first."""

from collections.abc import Sequence

from rich.console import Console
from rich.text import Text

from swarmwire.deploy.terminal.rows import print_rows
from swarmwire.metrics.sim_to_real.comparison import SimToReal
from swarmwire.metrics.sim_to_real.texts import (
    COLUMNS,
    RADIO_COLUMNS,
    left_out,
    meanings,
    metric_cells,
    radio_cells,
    verdict,
)


def print_sim_to_real(of: SimToReal, told: Sequence[str], console: Console) -> None:
    """All of it; `told` is what differs in the settings, and what is amiss with the logs, a line each."""
    for line in told:
        console.print(Text(f"note: {line}"), soft_wrap=True)
    if of.rows:
        print_rows(COLUMNS, [metric_cells(row) for row in of.rows], console, gap=True)
    if of.radio:
        print_rows(RADIO_COLUMNS, [radio_cells(row) for row in of.radio], console, gap=True)
    for line in (*left_out(of), *meanings(of)):
        console.print(Text(line, "dim"), soft_wrap=not console.is_terminal)
    console.print(Text(verdict(of), "bold"), soft_wrap=True)

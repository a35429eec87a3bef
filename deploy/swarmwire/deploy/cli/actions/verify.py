"""`swarmwire verify`: the files of a run folder."""

from pathlib import Path

import typer
from rich.table import Table
from rich.text import Text

from swarmwire.comms.base.printable import printable
from swarmwire.deploy.cli.options import FAILED
from swarmwire.deploy.terminal.console import TerminalConsole
from swarmwire.metrics.records.run_folder.verify import verify

STYLES = {"intact": "green", "not recorded": "dim", "partial": "yellow"}  # style by state, red for all others


def verify_folder(folder: Path) -> None:
    """Read all files of a run folder, and print the state of each."""
    findings = verify(folder)
    console = TerminalConsole()
    table = Table(title=Text(str(folder)), title_justify="left", title_style="bold")
    for column in ("part", "state", ""):
        table.add_column(column, overflow="fold")
    for finding in findings:
        style = STYLES.get(finding.state, "red")
        table.add_row(Text(printable(finding.part)), Text(finding.state, style=style), Text(printable(finding.text)))
    console.print(table)
    faults = [finding for finding in findings if not finding.good]
    if faults:
        text = ", ".join(f"{finding.part} {finding.state}" for finding in faults)
        console.print(f"not intact: {text}", soft_wrap=True)
        raise typer.Exit(FAILED)
    console.print("intact: everything is there, readable, and as the summary says")

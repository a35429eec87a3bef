"""`swarmwire verify`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from swarmwire.deploy.cli.exit_codes import FAILED

STYLES = {"intact": "green", "not recorded": "dim", "partial": "yellow"}  # red for the others


def verify_command(
    folder: Annotated[Path, typer.Argument(help="A run folder.", metavar="RUN")],
) -> None:
    """Check a run folder: read all of it, compare it with its summary, and say what is missing.

    Exit code 0: intact; 1: incomplete or damaged (what a killed run left can still be read); 2: no run folder.
    """
    from swarmwire.metrics.run_folder.verify import verify

    findings = verify(folder)
    console = Console(highlight=False)
    table = Table(title=Text(str(folder)), title_justify="left", title_style="bold")
    for column in ("part", "state", ""):
        table.add_column(column, overflow="fold")
    for finding in findings:
        style = STYLES.get(finding.state, "red")
        table.add_row(Text(finding.part), Text(finding.state, style=style), Text(finding.text))
    console.print(table)
    bad = [finding for finding in findings if not finding.good]
    if bad:
        console.print("not intact: " + ", ".join(f"{finding.part} {finding.state}" for finding in bad), soft_wrap=True)
        raise typer.Exit(FAILED)
    console.print("intact: everything is there, readable, and as the summary says")

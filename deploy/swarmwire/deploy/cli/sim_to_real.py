"""`swarmwire sim-to-real`."""

from pathlib import Path
from typing import Annotated

import typer


def sim_to_real_command(
    emulated: Annotated[
        str,
        typer.Argument(
            help="The folder of a run, or of a campaign for the spread over its seeds (FOLDER@radio.loss=0.4: a part).",
            metavar="EMULATED_RUN",
        ),
    ],
    log: Annotated[
        Path, typer.Argument(help="Folder with a folder per robot, or that of one robot.", metavar="REAL_LOG")
    ],
    to: Annotated[
        Path | None, typer.Option(help="A page with the distributions, too; figures go beside it.", metavar="FILE.html")
    ] = None,
    csv: Annotated[Path | None, typer.Option(help="Write the numbers to this file, too.", metavar="FILE.csv")] = None,
) -> None:
    """Hold a log of real robots against emulated runs: the same metrics side by side, and how far apart they are.

    With a campaign each metric is within the spread if the log is no farther from the runs than the runs are from one
    another. What a log cannot know (contacts, times on air, who is within range) is left out. For example:

      swarmwire robots logs fleet.toml --fetch logs/monday

      swarmwire sim-to-real campaigns/lab logs/monday --to sim-to-real.html
    """
    # Imported here: polars, scipy and numba take a second, which --help should not.
    from rich.console import Console

    from swarmwire.deploy.sim_to_real import differing_settings, read_emulation
    from swarmwire.deploy.terminal.tables import print_sim_to_real
    from swarmwire.metrics.atomic import check_output_path
    from swarmwire.metrics.real_log.real_logs import read_real_logs
    from swarmwire.metrics.sim_to_real.comparison import compare_sim_to_real
    from swarmwire.metrics.sim_to_real.report import write_sim_to_real
    from swarmwire.metrics.sim_to_real.runs import measured_log

    for path, suffixes in ((to, (".html", ".htm")), (csv, (".csv",))):
        if path is not None:
            check_output_path(path, suffixes)
    logs, emulation = read_real_logs(log), read_emulation(emulated)
    shortest_s = min(run.duration_s for run in emulation.runs.runs)
    measured = measured_log(logs, emulation.metrics, emulation.static, shortest_s)
    found = compare_sim_to_real(emulation.runs, measured, emulation.metrics)
    told = [*(f"different {line}" for line in differing_settings(emulation, logs)), *measured.notes]
    print_sim_to_real(found, told, Console(highlight=False))
    if to is not None:
        from swarmwire.metrics.report.page import write_report
        from swarmwire.metrics.sim_to_real.report import sim_to_real_report

        write_report(sim_to_real_report(found, f"{emulation.runs.name} and {log.name}", told), to)
        typer.echo(f"written: {to}")
    if csv is not None:
        write_sim_to_real(found, csv)
        typer.echo(f"written: {csv}")

"""`swarmwire compare`, `report` and `sim-to-real`: what campaigns, runs and robots' logs say."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.terminal.output import echo

if TYPE_CHECKING:
    from rich.console import Console

    from swarmwire.metrics.pictures.report.page import Report
    from swarmwire.metrics.records.campaign.compare import CampaignComparison

HELP = "A campaign's folder; FOLDER@radio.loss=0.4 is that part of it."


def compare_command(
    a: Annotated[str, typer.Argument(help=HELP, metavar="A")],
    b: Annotated[str, typer.Argument(help=HELP, metavar="B")],
    response: Annotated[
        list[str] | None,
        typer.Option(help="A column of responses, or a metric for its last value. Repeatable.", metavar="NAME"),
    ] = None,
    to: Annotated[Path | None, typer.Option(help="Also write the numbers to this file.", metavar="FILE.csv")] = None,
) -> None:
    """Compare two campaigns: medians, their difference and its interval, at each common design point.

    Points that agree in every parameter that both vary are compared, and seeds that both ran one by one. Unless
    responses are named they are all times, the last values of metrics, and the link PDR. For example:

      swarmwire compare campaigns/plain campaigns/smoothed --response order

      swarmwire compare campaigns/loss@radio.loss=0 campaigns/loss@radio.loss=0.4
    """
    # Imported here: polars and scipy take a second, which --help should not.
    from swarmwire.deploy.terminal.console import TerminalConsole
    from swarmwire.metrics.records.campaign.compare import compare, write_comparison
    from swarmwire.metrics.records.campaign.folder import select

    found = compare(select(a), select(b), response or [])
    print_comparison(found, TerminalConsole())
    if to is not None:
        write_comparison(found, to)
        echo(f"written: {to}")


def report_command(
    folder: Annotated[Path, typer.Argument(help="The folder of a campaign or of a run.", metavar="DIR")],
    response: Annotated[
        list[str] | None,
        typer.Option(
            help="Of a campaign: a column, or a metric for its last value. Repeatable. Default: eight at most.",
            metavar="NAME",
        ),
    ] = None,
    label: Annotated[
        list[str] | None,
        typer.Option(
            help="Of a campaign: the text for a parameter or response in figures. Repeatable.", metavar="NAME=TEXT"
        ),
    ] = None,
    to: Annotated[
        Path | None,
        typer.Option(help="The page; figures go to a folder beside it. Default: report.html in DIR.", metavar="FILE"),
    ] = None,
) -> None:
    """Make a report of a campaign or of a run: one page that needs nothing else, and its figures (SVG, PDF) beside it.

    Unfinished campaigns and runs are accepted. Default responses are times, last values of metrics and the link PDR, of
    those that differ between runs; tables that are folded hold the others. For example:

      swarmwire report campaigns/loss --response aggregation_time_s --label radio.loss="packet loss"
    """
    # Imported here: matplotlib and scipy take a second, which --help should not.
    from swarmwire.metrics.pictures.report.page import PAGE, write_report

    report = _report(folder, response or [], _labels(label or []))
    written = write_report(report, to or folder / PAGE)
    echo(f"written: {written[0]}")
    if len(written) > 1:
        echo(f"written: {written[1].parent} ({len(report.figures)} figures, as SVG and PDF)")


def _labels(texts: list[str]) -> dict[str, str]:
    """The labels that `--label NAME=TEXT` gives."""
    labels: dict[str, str] = {}
    for text in texts:
        name, equals, label = text.partition("=")
        if not equals or not name.strip() or not label.strip():
            raise BadInput("--label", text, "expected NAME=TEXT")
        labels[name.strip()] = label.strip()
    return labels


def _report(folder: Path, responses: list[str], labels: dict[str, str]) -> "Report":
    """Of whatever the folder holds; BadInput where it is neither a campaign nor a run."""
    from swarmwire.metrics.pictures.report.campaign import campaign_report
    from swarmwire.metrics.pictures.report.run import run_report
    from swarmwire.metrics.records.campaign.campaign_json import CAMPAIGN_FILE
    from swarmwire.metrics.records.campaign.folder import CampaignFolder
    from swarmwire.metrics.records.run_folder.layout import STATIC

    if (folder / CAMPAIGN_FILE).exists():
        return campaign_report(CampaignFolder(folder), responses, labels)
    if not (folder / STATIC).exists():
        raise BadInput(str(folder), "", f"expected the folder of a campaign ({CAMPAIGN_FILE}) or of a run ({STATIC})")
    if labels:
        raise BadInput("--label", next(iter(labels)), "expected a campaign")
    if responses:
        raise BadInput("--response", responses[0], "expected a campaign: a run has all its metrics in its report")
    return run_report(folder)


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
        list[Path] | None,
        typer.Option(
            help="Also write a file. .html: a page with the distributions, its figures beside it; .csv: the numbers. "
            "Repeatable.",
            metavar="FILE",
        ),
    ] = None,
) -> None:
    """Compare a log of real robots with simulated runs: the same metrics side by side, and their differences.

    With a campaign each metric is within the spread if the log is no farther from the runs than the runs are from one
    another. Values that a log cannot hold (contacts, airtime, robots within range) are left out. For example:

      swarmwire robots logs fleet.toml --fetch logs/monday

      swarmwire sim-to-real campaigns/lab logs/monday --to sim-to-real.html
    """
    # Imported here: polars, scipy and numba take a second, which --help should not.
    from swarmwire.comms.base.atomic import check_output_path
    from swarmwire.deploy.cli.sim_to_real import differing_settings, print_sim_to_real, read_emulation
    from swarmwire.deploy.terminal.console import TerminalConsole
    from swarmwire.metrics.real.real_log.real_logs import read_real_logs
    from swarmwire.metrics.real.sim_to_real.comparison import compare_sim_to_real
    from swarmwire.metrics.real.sim_to_real.report import write_sim_to_real
    from swarmwire.metrics.real.sim_to_real.runs import measured_log

    for path in to or []:
        check_output_path(path, (".html", ".csv"))
    logs, emulation = read_real_logs(log), read_emulation(emulated)
    shortest_s = min(run.duration_s for run in emulation.runs.runs)
    measured = measured_log(logs, emulation.metrics, emulation.static, shortest_s)
    found = compare_sim_to_real(emulation.runs, measured, emulation.metrics)
    notes = [*(f"different {line}" for line in differing_settings(emulation, logs)), *measured.notes]
    print_sim_to_real(found, notes, TerminalConsole())
    for path in to or []:
        if path.suffix.lower() == ".csv":
            write_sim_to_real(found, path)
        else:
            from swarmwire.metrics.pictures.report.page import write_report
            from swarmwire.metrics.real.sim_to_real.report import sim_to_real_report

            write_report(sim_to_real_report(found, f"{emulation.runs.name} and {log.name}", notes), path)
        echo(f"written: {path}")


def print_comparison(comparison: "CampaignComparison", console: "Console") -> None:
    """Print the rows of a comparison of campaigns, then notes on their meaning."""
    from rich.text import Text

    from swarmwire.deploy.terminal.tables import print_rows
    from swarmwire.metrics.records.campaign.compare import COLUMNS, cells, notes

    print_rows(COLUMNS, [cells(comparison, row) for row in comparison.rows], console, gap=True)
    for note in notes(comparison):
        console.print(Text(note, "dim"), soft_wrap=not console.is_terminal)

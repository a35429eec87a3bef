"""The commands `compare`, `expect`, `report` and `sim-to-real`: results of campaigns, runs and robots' logs."""

from pathlib import Path
from typing import Annotated

import typer

from swarmwire.deploy.cli.options import BagPackets, BagPoses

CAMPAIGN_HELP = "A campaign's folder; FOLDER@radio.loss=0.4 is that part of it."


def compare_command(
    a: Annotated[str, typer.Argument(help=CAMPAIGN_HELP, metavar="A")],
    b: Annotated[str, typer.Argument(help=CAMPAIGN_HELP, metavar="B")],
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
    from swarmwire.deploy.cli.actions.compare import compare_campaigns

    compare_campaigns(a, b, response or [], to)


def expect_command(
    folder: Annotated[
        str,
        typer.Argument(help="The folder of a run or of a campaign; FOLDER@radio.loss=0.4 is a part.", metavar="DIR"),
    ],
    expectations: Annotated[
        list[str],
        typer.Argument(
            help="'order.final >= 0.9', 'stop_time_s.mean < 60', 'radio.pdr > 0.5 in 80 % of runs'.",
            metavar="EXPECTATION...",
        ),
    ],
    junit: Annotated[
        Path | None, typer.Option(help="Also write a JUnit report, as services of CI show it.", metavar="FILE.xml")
    ] = None,
) -> None:
    """Check that a run or a campaign meets expectations: a line each, and exit code 1 if one is not met.

    A name is a column of the campaign's table, a metric for its last value, or with .mean its mean over the runs
    instead of the median. At each design point the whole 95 % interval must meet the bound, or with "in 80 % of runs"
    the lower end of the interval of that share. A failed or missing run meets nothing. For example:

      swarmwire expect campaigns/loss@radio.loss=0.2 'order.final >= 0.9'

      swarmwire expect runs/today 'radio.pdr >= 0.5' 'counts.nan_commands <= 0' --junit expect.xml
    """
    from swarmwire.deploy.cli.actions.expect import check_expectations

    check_expectations(folder, expectations, junit)


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
    from swarmwire.deploy.cli.actions.report import make_report

    make_report(folder, response or [], label or [], to)


def sim_to_real_command(
    emulated: Annotated[
        str,
        typer.Argument(
            help="The folder of a run, or of a campaign for the spread over its seeds (FOLDER@radio.loss=0.4: a part).",
            metavar="EMULATED_RUN",
        ),
    ],
    log: Annotated[
        Path,
        typer.Argument(
            help="Folder with a folder per robot, or that of one robot, or a bag of ROS 2.", metavar="REAL_LOG"
        ),
    ],
    to: Annotated[
        list[Path] | None,
        typer.Option(
            help="Also write a file. .html: a page with the distributions, its figures beside it; .csv: the numbers. "
            "Repeatable.",
            metavar="FILE",
        ),
    ] = None,
    poses: BagPoses = None,
    packets: BagPackets = None,
) -> None:
    """Compare a log of real robots with simulated runs: the same metrics side by side, and their differences.

    With a campaign each metric is within the spread if the log is no farther from the runs than the runs are from one
    another. Values that a log cannot hold (contacts, airtime, robots within range) are left out. For example:

      swarmwire robots logs fleet.toml --fetch logs/monday

      swarmwire sim-to-real campaigns/lab logs/monday --to sim-to-real.html
    """
    from swarmwire.deploy.cli.actions.bag_logs import BagTopics
    from swarmwire.deploy.cli.actions.sim_to_real import compare_with_logs

    compare_with_logs(emulated, log, to or [], BagTopics(poses, packets))

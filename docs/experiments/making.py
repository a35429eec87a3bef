"""An experiment from its campaign files to its figure: what is missing is swept, digested and drawn.

Digests are the columns of campaigns' tables that an experiment's figure and numbers are made from.
"""

import csv
import io
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import polars as pl
import typer
from rich.console import Console

from docs.experiments.experiment import Experiment, Layout
from swarmwire.comms.base.atomic import output_file, write_text
from swarmwire.comms.base.config import did_you_mean
from swarmwire.comms.base.errors import BadInput, Interrupted, SwarmwireError
from swarmwire.deploy.campaigns.spec import campaign_file, plan_of, spec_in
from swarmwire.deploy.campaigns.sweep import ExecutionOptions, Sweep, begin_sweep, check_same, resume_sweep
from swarmwire.deploy.cli.app import let_help_flow
from swarmwire.deploy.cli.display.sweep import SweepProgress
from swarmwire.deploy.cli.options import BAD_INPUT, FAILED, INTERRUPTED
from swarmwire.deploy.terminal.output import echo
from swarmwire.metrics.pictures.drawing.canvas import save
from swarmwire.metrics.records.campaign.campaign_json import CAMPAIGN_FILE, read_campaign
from swarmwire.metrics.records.campaign.folder import CampaignFolder

BEGIN = ("run", "point", "seed")
ENDS = ("ended", "stop_time_s", "stopped_by", "sim_time_s")  # those that a campaign has
LAST = ("timing_wall_s",)
MAX_BYTES = 2_000_000  # of all digests of an experiment: they are kept with the code
LONG_ROWS, LONG_CELLS = 8, 35  # a table with at least as many of either is a CSV file
TABLE = re.compile(r"(?:^\|.*\n)+", re.MULTILINE)
BEGIN_MARK, END_MARK = "<!-- numbers -->", "<!-- /numbers -->"


def digest(experiment: Experiment, layout: Layout, folders: Sequence[Path] = ()) -> list[Path]:
    """Write the digests of an experiment's campaigns, each of which must be over; the files that were written.

    `folders` are campaigns' folders, named as the campaigns, or a single one; none: all that lie where they are swept.
    BadInput for a folder that is of no campaign of the experiment, or not over, and for digests that are too large.
    """
    written: list[Path] = []
    for campaign, folder in _folders(experiment, layout, folders).items():
        frame = digest_of(experiment, folder)
        layout.data.mkdir(parents=True, exist_ok=True)
        written.append(layout.data / f"{campaign}.parquet")
        with output_file(written[-1]) as aside:
            frame.write_parquet(aside, compression="zstd", compression_level=9, statistics=False)
    size = sum(file.stat().st_size for file in _files(experiment, layout) if file.exists())
    if size > MAX_BYTES:
        expected = f"expected at most {MAX_BYTES / 1e6:g} MB in all, got {size / 1e6:.1f}: keep fewer columns"
        raise BadInput(str(layout.data), experiment.name, expected)
    return written


def digest_of(experiment: Experiment, folder: Path) -> pl.DataFrame:
    """The digest of one campaign; BadInput unless it is over and has the columns that are wanted."""
    campaign = CampaignFolder(folder)
    if not campaign.finished:
        lacking = f"{len(campaign.missing)} of {campaign.about.runs} runs are missing"
        raise BadInput(
            str(folder), "", f"expected a campaign that is over; {lacking}: swarmwire sweep --resume {folder}"
        )
    custom = experiment.digested(folder, campaign.runs)
    if custom is not None:
        return custom
    columns = campaign.runs.columns
    for name in experiment.columns:
        if name not in columns:
            raise BadInput(
                str(folder), name, f"expected a column that the campaign has: {did_you_mean(tuple(columns), name)}"
            )
    ends = [name for name in ENDS if name in columns]
    chosen = dict.fromkeys((*BEGIN, *campaign.parameters, *ends, *experiment.columns, *LAST))
    return campaign.runs.select(*chosen)


def digests(experiment: Experiment, layout: Layout) -> Mapping[str, pl.DataFrame]:
    """The digests of an experiment by campaign; BadInput if one is missing."""
    for file in _files(experiment, layout):
        if not file.exists():
            raise BadInput(str(file), "", f"is missing: expected a digest; run or digest {experiment.name} first")
    return {file.stem: pl.read_parquet(file) for file in _files(experiment, layout)}


def _files(experiment: Experiment, layout: Layout) -> list[Path]:
    return [layout.data / f"{campaign}.parquet" for campaign in experiment.campaigns]


def _folders(experiment: Experiment, layout: Layout, folders: Sequence[Path]) -> dict[str, Path]:
    """Folders by campaign."""
    campaigns = experiment.campaigns
    if not folders:
        return {campaign: layout.swept / campaign for campaign in campaigns}
    if len(folders) == len(campaigns) == 1:
        return {campaigns[0]: folders[0]}
    for folder in folders:
        if folder.name not in campaigns:
            raise BadInput(
                "FOLDER",
                str(folder),
                f"expected a folder named as its campaign: {did_you_mean(campaigns, folder.name)}",
            )
    return {folder.name: folder for folder in folders}


def draw(experiment: Experiment, layout: Layout) -> str:
    """Draw an experiment, put its numbers into its page if there is one, and return them.

    BadInput where a digest is missing, or the page has no place for the numbers.
    """
    runs = digests(experiment, layout)
    numbers_text = experiment.numbers(runs)
    page = layout.pages / f"{experiment.page}.md"
    files = page_files(page, experiment.name, numbers_text) if page.exists() else {}
    save(experiment.draw(runs), layout.figure_of(experiment.name))
    for file, text in files.items():
        file.parent.mkdir(exist_ok=True)
        write_text(file, text)
    return numbers_text


def page_files(page: Path, name: str, numbers_text: str) -> dict[Path, str]:
    """Texts by file: the page with an experiment's numbers between its marks, and a CSV file for each long table.

    BadInput unless the page has both marks, once.
    """
    text = page.read_text(encoding="utf-8")
    begin = BEGIN_MARK if name == page.stem else f"<!-- numbers: {name} -->"
    files: dict[Path, str] = {}

    def replacement(table: re.Match[str]) -> str:
        rows = [re.split(r"(?<!\\)\|", line.strip())[1:-1] for line in table[0].splitlines()]
        if len(rows) - 2 < LONG_ROWS and (len(rows) - 2) * len(rows[0]) < LONG_CELLS:
            return table[0]
        file = page.parent / "numbers" / f"{name}-{len(files) + 1}.csv"
        files[file] = csv_text([[cell.strip().replace(r"\|", "|") for cell in row] for row in (rows[0], *rows[2:])])
        path = file.relative_to(page.parent)
        return f"Table: [{file.name}]({path})\n\n```{{csv-table}}\n:file: {path}\n:header-rows: 1\n```\n"

    numbers_text = TABLE.sub(replacement, f"{numbers_text}\n").rstrip("\n")
    before, _, below = text.partition(begin)
    between, end, after = below.partition(END_MARK)
    if text.count(begin) != 1 or not end or "<!-- numbers" in between:
        raise BadInput(str(page), "", f"expected one line {begin}, and {END_MARK} below it")
    files[page] = f"{before}{begin}\n{numbers_text}\n{END_MARK}{after}"
    return files


def csv_text(rows: Sequence[Sequence[str]]) -> str:
    """Return rows as CSV."""
    file = io.StringIO()
    csv.writer(file, lineterminator="\n").writerows(rows)
    return file.getvalue()


def run(experiment: Experiment, layout: Layout, seeds: str | None, options: ExecutionOptions, console: Console) -> str:
    """Sweep what is missing of an experiment's campaigns, digest and draw it; the numbers.

    With `seeds` other seeds than the campaigns' own are taken, in folders of their own. BadInput as of `swarmwire
    sweep`, and if a campaign that lies there is not the one that its file describes now; Interrupted by Ctrl-C: the
    same call goes on.
    """
    where = layout if seeds is None else layout.trial(seeds)
    for name in experiment.campaigns:
        swept = _swept(where.campaigns / f"{name}.toml", where.swept / name, seeds, options, console)
        if swept is not None and not swept.is_over:
            raise Interrupted(f"{swept.done} of {swept.runs} runs of {name} are done: the same command goes on")
    digest(experiment, where)
    return draw(experiment, where)


def _swept(file: Path, folder: Path, seeds: str | None, options: ExecutionOptions, console: Console) -> Sweep | None:
    """How far the campaign has come; None: it had been finished before."""
    campaign = campaign_file(file)
    if campaign is None:
        raise BadInput(str(file), "", "expected a campaign, not a scenario")
    plan = plan_of(spec_in(file, campaign, seeds))
    options = replace(options, observer=SweepProgress(console))
    if not (folder / CAMPAIGN_FILE).exists():
        return begin_sweep(plan, folder, f"swarmwire sweep {file.name}", options)
    if not CampaignFolder(folder).finished:
        return resume_sweep(folder, options, plan=plan)
    check_same(plan, read_campaign(folder), folder)
    console.print(f"there already: {folder}", soft_wrap=True)
    return None


def run_app(app: typer.Typer) -> None:
    """Run what the arguments say; every error of ours is one line."""
    let_help_flow(app)
    try:
        app()
    except SwarmwireError as error:
        echo(f"error: {error}", err=True)
        sys.exit(_exit_code_of(error))


def _exit_code_of(error: SwarmwireError) -> int:
    if isinstance(error, BadInput):
        return BAD_INPUT
    return INTERRUPTED if isinstance(error, Interrupted) else FAILED

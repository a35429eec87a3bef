"""Digests: the columns of campaigns' tables that an experiment's figure and numbers are made from."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import polars as pl

from docs.experiments.experiment import Experiment
from docs.experiments.places import Places
from swarmwire.comms.config import did_you_mean
from swarmwire.comms.errors import BadInput
from swarmwire.metrics.atomic import output_file
from swarmwire.metrics.campaign.folder import CampaignFolder

BEGIN = ("run", "point", "seed")
ENDS = ("ended", "stop_time_s", "stopped_by", "sim_time_s")  # those that a campaign has
LAST = ("timing_wall_s",)
MAX_BYTES = 2_000_000  # of all digests of an experiment: they are kept with the code


def digest(experiment: Experiment, places: Places, folders: Sequence[Path] = ()) -> list[Path]:
    """Write the digests of an experiment's campaigns, each of which must be over; the files that were written.

    `folders` are campaigns' folders, named as the campaigns, or a single one; none: all that lie where they are swept.
    BadInput for a folder that is of no campaign of the experiment, or not over, and for digests that are too large.
    """
    written: list[Path] = []
    for campaign, folder in _folders(experiment, places, folders).items():
        frame = digest_of(experiment, folder)
        places.data.mkdir(parents=True, exist_ok=True)
        written.append(places.data / f"{campaign}.parquet")
        with output_file(written[-1]) as aside:
            frame.write_parquet(aside, compression="zstd", compression_level=9, statistics=False)
    size = sum(file.stat().st_size for file in _files(experiment, places) if file.exists())
    if size > MAX_BYTES:
        kept = f"expected at most {MAX_BYTES / 1e6:g} MB in all, got {size / 1e6:.1f}: keep fewer columns"
        raise BadInput(str(places.data), experiment.name, kept)
    return written


def digest_of(experiment: Experiment, folder: Path) -> pl.DataFrame:
    """The digest of one campaign; BadInput unless it is over and has the columns that the experiment wants."""
    campaign = CampaignFolder(folder)
    if not campaign.finished:
        lacking = f"{len(campaign.missing)} of {campaign.about.runs} runs are missing"
        raise BadInput(
            str(folder), "", f"expected a campaign that is over; {lacking}: swarmwire sweep --resume {folder}"
        )
    own = experiment.digested(folder, campaign.runs)
    if own is not None:
        return own
    there = campaign.runs.columns
    for name in experiment.columns:
        if name not in there:
            raise BadInput(
                str(folder), name, f"expected a column that the campaign has: {did_you_mean(tuple(there), name)}"
            )
    ends = [name for name in ENDS if name in there]
    chosen = dict.fromkeys((*BEGIN, *campaign.parameters, *ends, *experiment.columns, *LAST))
    return campaign.runs.select(*chosen)


def digests(experiment: Experiment, places: Places) -> Mapping[str, pl.DataFrame]:
    """The digests of an experiment by campaign; BadInput if one is missing."""
    for file in _files(experiment, places):
        if not file.exists():
            raise BadInput(str(file), "", f"is missing: expected a digest; run or digest {experiment.name} first")
    return {file.stem: pl.read_parquet(file) for file in _files(experiment, places)}


def _files(experiment: Experiment, places: Places) -> list[Path]:
    return [places.data / f"{campaign}.parquet" for campaign in experiment.campaigns]


def _folders(experiment: Experiment, places: Places, given: Sequence[Path]) -> dict[str, Path]:
    """Folders by campaign."""
    known = experiment.campaigns
    if not given:
        return {campaign: places.swept / campaign for campaign in known}
    if len(given) == len(known) == 1:
        return {known[0]: given[0]}
    for folder in given:
        if folder.name not in known:
            raise BadInput(
                "FOLDER", str(folder), f"expected a folder named as its campaign: {did_you_mean(known, folder.name)}"
            )
    return {folder.name: folder for folder in given}

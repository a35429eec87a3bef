"""`trials.parquet`: a row for each trial that is over."""

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

from swarmwire.deploy.campaign.storage import storing
from swarmwire.deploy.tuning.search import Search
from swarmwire.deploy.tuning.trial import Trial
from swarmwire.deploy.tuning.tuning import Tuning
from swarmwire.metrics.atomic import atomic_write
from swarmwire.metrics.run_folder.writer import PARQUET

FILE = "trials.parquet"


def write_trials(folder: Path, tuning: Tuning, trials: Sequence[Trial]) -> None:
    """Write the table of trials that are over anew: number, state, a column of each path, what came of it.

    StorageFailed if the disk refuses.
    """
    import polars as pl

    rows = [
        {
            "trial": trial.number,
            "state": trial.state,
            **{search.path: trial.parameters[search.path] for search in tuning.searches},
            "value": trial.result.value,
            **trial.result.attributes(),
            "error": trial.result.error or None,
        }
        for trial in trials
    ]
    kinds = {
        "trial": "whole",
        "state": "text",
        **{search.path: _type(search) for search in tuning.searches},
        **dict.fromkeys(("value", "statistic", "censored"), "number"),
        **dict.fromkeys(("undefined", "failed"), "whole"),
        "error": "text",
    }
    types = {"whole": pl.Int64(), "text": pl.String(), "number": pl.Float64()}
    file = BytesIO()  # in memory first: what a full disk then says is an OSError
    pl.DataFrame(rows, {name: types[kind] for name, kind in kinds.items()}).write_parquet(file, **PARQUET)
    with storing(folder, "tune"), atomic_write(folder / FILE) as aside:
        aside.write_bytes(file.getvalue())


def _type(search: Search) -> str:
    if search.choices:
        return "text"
    return "whole" if search.whole else "number"

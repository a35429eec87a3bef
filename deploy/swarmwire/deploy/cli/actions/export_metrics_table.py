"""A table of the metrics of a run over time."""

import csv
import math
from pathlib import Path

from swarmwire.comms.base.arrays import BoolArray, FloatArray
from swarmwire.comms.base.atomic import check_output_path, output_file
from swarmwire.comms.base.config import did_you_mean
from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.cli.exporters import METRICS, ExportOptions
from swarmwire.metrics.pictures.drawing.film import film_of
from swarmwire.metrics.records.run_folder.reader import RunFolder


def write_table(run: Path, to: Path, options: ExportOptions) -> str:
    """Write a row per tick: `time_s`, then a column per metric; an undefined value is an empty field."""
    film = film_of(RunFolder(run), options.arena or 0, str(run))
    check_output_path(to, METRICS.suffixes)
    names = options.metrics or list(film.metrics)
    for name in names:
        if name not in film.metrics:
            raise BadInput("--metric", name, f"was not recorded; expected {did_you_mean(film.metrics, name)}")
    ticks = chosen_ticks(film.time_s, options)
    columns = [film.time_s[ticks].tolist(), *(film.metrics[name][ticks].tolist() for name in names)]
    with output_file(to) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["time_s", *names])
        writer.writerows(["" if math.isnan(value) else value for value in row] for row in zip(*columns, strict=True))
    return f"{int(ticks.sum())} rows"


def chosen_ticks(time_s: FloatArray, options: ExportOptions) -> BoolArray:
    """Return True for the ticks (T,) from `from_s` to `until_s`; BadInput if there is none."""
    from_s = -math.inf if options.from_s is None else options.from_s
    until_s = math.inf if options.until_s is None else options.until_s
    ticks = (time_s >= from_s) & (time_s <= until_s)
    if not ticks.any():
        first, last = float(time_s[0]), float(time_s[-1])
        raise BadInput("--from", "", f"expected a time that was recorded, {first:g} to {last:g} s")
    return ticks

"""The metrics of a run over time, as CSV."""

import csv
import math
from pathlib import Path

from swarmwire.comms.config import did_you_mean
from swarmwire.comms.errors import BadInput
from swarmwire.deploy.export.exporter import Exporter, ExportOptions


def _write(run: Path, to: Path, options: ExportOptions) -> str:
    """A row per tick: `time_s`, then a column per metric; a value that is undefined is an empty field."""
    from swarmwire.metrics.atomic import check_output_path, output_file
    from swarmwire.metrics.drawing.film import film_of
    from swarmwire.metrics.run_folder.reader import RunFolder

    film = film_of(RunFolder(run), options.arena or 0, str(run))
    check_output_path(to, (".csv",))
    names = options.metrics or list(film.metrics)
    for name in names:
        if name not in film.metrics:
            raise BadInput("--metric", name, f"was not recorded; expected {did_you_mean(film.metrics, name)}")
    from_s = -math.inf if options.from_s is None else options.from_s
    until_s = math.inf if options.until_s is None else options.until_s
    shown = (film.time_s >= from_s) & (film.time_s <= until_s)
    if not shown.any():
        first, last = float(film.time_s[0]), float(film.time_s[-1])
        raise BadInput("--from", "", f"expected a time that was recorded, {first:g} to {last:g} s")
    columns = [film.time_s[shown].tolist(), *(film.metrics[name][shown].tolist() for name in names)]
    with output_file(to) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["time_s", *names])
        writer.writerows(["" if math.isnan(value) else value for value in row] for row in zip(*columns, strict=True))
    return f"{int(shown.sum())} rows"


METRICS = Exporter("metrics", (".csv",), frozenset({"from_s", "until_s", "arena", "metrics"}), _write)

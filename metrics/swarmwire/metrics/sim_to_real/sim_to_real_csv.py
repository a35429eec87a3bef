"""A sim-to-real comparison as a table for programs."""

import csv
import math
from pathlib import Path

from swarmwire.metrics.atomic import check_output_path, output_file
from swarmwire.metrics.sim_to_real.comparison import SimToReal

COLUMNS = (
    "name",
    "what",
    "unit",
    "kind",
    "runs",
    "emulated_q05",
    "emulated_q50",
    "emulated_q95",
    "log",
    "distance",
    "spread",
    "ks",
    "difference_low",
    "difference_high",
    "within",
)


def write_sim_to_real(of: SimToReal, to: Path) -> None:
    """Write a row per metric and number of the radio; BadInput unless the path is that of a .csv that can be written.

    Empty: unknown. `what` is metric or radio; of what was not in the log or not compared, all numbers are empty.
    """
    check_output_path(to, (".csv",))
    with output_file(to) as aside, aside.open("w", encoding="utf-8", newline="") as file:
        writer: csv.DictWriter[str] = csv.DictWriter(file, list(COLUMNS), restval="")
        writer.writeheader()
        writer.writerows(_rows(of))


def _rows(of: SimToReal) -> list[dict[str, str]]:
    rows: list[dict[str, str]] = []
    for row in of.rows:
        about = {"name": row.metric.name, "what": "metric", "unit": row.metric.unit, "kind": row.metric.kind}
        numbers = {
            "runs": len(row.runs),
            "emulated_q05": row.emulated.low,
            "emulated_q50": row.emulated.median,
            "emulated_q95": row.emulated.high,
            "log": row.log,
            "distance": row.distance,
            "spread": row.reach,
            "ks": row.ks,
            "difference_low": row.difference.low,
            "difference_high": row.difference.high,
        }
        rows.append(about | _texts(numbers) | {"within": _word(row.within)})
    for row in of.radio:
        about = {"name": row.of.name, "what": "radio", "unit": row.of.unit, "kind": "total"}
        numbers = {
            "runs": row.runs,
            "emulated_q05": row.emulated.low,
            "emulated_q50": row.emulated.median,
            "emulated_q95": row.emulated.high,
            "log": row.of.log,
        }
        rows.append(about | _texts(numbers) | {"within": _word(row.within)})
    rows += [{"name": name, "what": "not in the log"} for name in of.not_in_log]
    return rows + [{"name": name, "what": "not compared"} for name in of.not_compared]


def _texts(numbers: dict[str, float]) -> dict[str, str]:
    return {name: "" if math.isnan(value) else str(value) for name, value in numbers.items()}


def _word(within: bool | None) -> str:
    return "" if within is None else "yes" if within else "no"

"""A comparison as a table for programs."""

import csv
import math
from pathlib import Path

from swarmwire.metrics.atomic import check_output_path, output_file
from swarmwire.metrics.campaign.comparison import Comparison, Row
from swarmwire.metrics.campaign.point_values import value_text
from swarmwire.metrics.statistics.summary import Summary

SUMMARIES = ("n", "failed", "undefined", "censored", "q25", "q50", "q75", "mean", "limit")


def write_comparison(comparison: Comparison, to: Path) -> None:
    """Write a row per response and pair of points; BadInput unless the path is that of a .csv that can be written.

    Columns: response, unit, kind; `a.PATH`, `b.PATH` of each parameter; `a_`, `b_` n, failed, undefined, censored, q25,
    q50, q75, mean, limit; pairs, median_difference with _low and _high, mean_difference with _low and _high, horizon,
    cliffs_delta, hedges_g, p, test. Empty: unknown; inf: open.
    """
    check_output_path(to, (".csv",))
    rows = [_cells(row) for row in comparison.rows]
    with output_file(to) as aside, aside.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def _cells(row: Row) -> dict[str, str]:
    of = row.difference
    cells = {"response": row.response.column, "unit": row.response.unit, "kind": row.response.kind}
    cells |= {f"a.{path}": value_text(value) for path, value in row.first_point.items()}
    cells |= {f"b.{path}": value_text(value) for path, value in row.second_point.items()}
    numbers = _summary("a", row.first) | _summary("b", row.second)
    numbers |= {
        "pairs": of.pairs,
        "median_difference": of.median,
        "median_difference_low": of.median_interval.low,
        "median_difference_high": of.median_interval.high,
        "mean_difference": of.mean,
        "mean_difference_low": of.mean_interval.low,
        "mean_difference_high": of.mean_interval.high,
        "horizon": of.horizon,
        "cliffs_delta": of.delta,
        "hedges_g": of.g,
        "p": of.p,
    }
    cells |= {name: "" if math.isnan(value) else str(value) for name, value in numbers.items()}
    return cells | {"test": of.test}


def _summary(letter: str, of: Summary) -> dict[str, float]:
    return {f"{letter}_{name}": getattr(of, name) for name in SUMMARIES}

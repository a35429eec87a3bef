"""Middleware on a moving mesh: delivery, age of information, discovery, recovery and cost of seven ways to publish."""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import polars as pl
from scipy import stats

from docs.experiments.figures._side_by_side import table as markdown
from examples.middleware.delivery import radio_use, read_logs, results, sent_late_p99_ms
from examples.middleware.node import START_S, TRANSPORTS
from swarmwire.metrics.pictures.drawing.canvas import ACCENT, CURVE, SMALL_PT, plain_axes
from swarmwire.metrics.pictures.report.page import blank_figure

CAMPAIGN = "middleware"
CAMPAIGNS = (CAMPAIGN,)
COLUMNS = ()  # `digested` chooses

NAME, LOSS = "robots.team.program.3", "radio.loss"
CLOSING = "Unable to push non droppable network message"  # zenoh then closes the transport (H6)
MAX_BEGIN_S = START_S + 1.0  # a run whose programs begin later does not count
COLORS = {0.0: CURVE, 0.2: ACCENT}
LIMIT_S = 20.0  # from the end of the split to that of a run
PANELS = (  # column, topic, title, limits
    ("delivery_before", "state", "states delivered, no split", (-0.03, 1.03)),
    ("delivery_within", "state", "states delivered in a half during the split", (-0.03, 1.03)),
    ("age_mean_s", "state", "mean age of states, s, no split", None),
    ("discovery_p50_s", "state", "discovery, median pair, s", (-0.5, 20.0)),
    ("recovery_p50_s", "state", "recovery after the split, median pair, s", (-0.5, LIMIT_S + 0.5)),
    ("delivery_across", "command", "commands across the split that arrive after it", (-0.03, 1.03)),
    ("delivery_before", "map", "maps delivered, no split", (-0.03, 1.03)),
    ("kB_per_s", "state", "frames of all robots, kB/s, with each hop", (0.0, 500.0)),
)
MEDIANS = "medians with\nintervals of 95 %, – where half of the runs have no value"
AGE, MAPS = ("age of states, s", ("state", "age_mean_s", ".2f")), ("maps delivered", ("map", "delivery_before", ".2f"))
STATES = "states delivered", ("state", "delivery_before", ".2f")
DIFFERENCES = (  # hypothesis, first and second middleware, title, and the topic, column and format
    ("H1", "zenoh-peer", "dds", *AGE),
    ("H1", "zenoh-peer", "dds-wifi", *AGE),
    ("H1", "zenoh-peer", "dds-wifi", "latency p95, ms", ("state", "latency_p95_ms", ".0f")),
    ("H3", "dds-wifi", "dds", *STATES),
    ("H3", "dds-wifi", "dds", *MAPS),
    ("", "dds-wifi", "udp", *AGE),
    ("", "zenoh-router", "zenoh-peer", *AGE),
    ("", "zenoh-router", "udp", *STATES),
    ("", "zenoh-router", "zenoh-peer", *STATES),
    ("", "zenoh-router", "zenoh-peer", "recovery p50, s", ("state", "recovery_p50_s", ".1f")),
    ("H7", "zenoh-peer", "udp", "recovery p50, s", ("state", "recovery_p50_s", ".1f")),
)


def digested(folder: Path, runs: pl.DataFrame) -> pl.DataFrame:
    """Return a row per run and topic, and one with topic null for each run that failed, in the order of programs."""
    rows: list[dict[str, Any]] = []
    losses = [LOSS] if LOSS in runs.columns else []  # other campaigns have one
    for run in runs.iter_rows(named=True):
        begin = {key: run[key] for key in (NAME, *losses, "seed", "ended", "error")}
        if run["ended"] == "failed":
            rows.append(begin)
            continue
        path = folder / "runs" / f"run-{run['run']:06d}"
        logs = read_logs(path)
        if logs.begin_s > MAX_BEGIN_S:
            begin |= {"ended": "failed", "error": f"late: the programs began {logs.begin_s:.1f} s after the start"}
            rows.append(begin)
            continue
        use = radio_use(path) | {"late": run["timing_late"], "sent_late_p99_ms": sent_late_p99_ms(path)}
        use["closings"] = sum(log.read_text(errors="replace").count(CLOSING) for log in path.glob("programs/*.log"))
        rows += [begin | row | use for row in results(logs)]
    order = pl.col(NAME).replace_strict({name: index for index, name in enumerate(TRANSPORTS)}, return_dtype=pl.Int64)
    return pl.DataFrame(rows, infer_schema_length=None).sort(order, *losses, "seed", "topic", nulls_last=True)


class Median(NamedTuple):
    """A median over seeds, and its interval of at least 95 % from order statistics; NaN with too few seeds."""

    value: float
    low: float
    high: float

    @classmethod
    def from_values(cls, values: pl.Series) -> "Median":
        """Return the median of values, a missing one being greater than any other.

        The interval is that of `scipy.stats.quantile_test`, which assumes nothing about the distribution.
        """
        ordered = np.sort(values.fill_null(np.inf).to_numpy().astype(np.float64))
        if not len(ordered):
            return cls(np.nan, np.nan, np.nan)
        low, high = stats.quantile_test(ordered, p=0.5).confidence_interval(0.95)
        return cls(float(np.median(ordered)), float(low), float(high))

    def text(self, form: str) -> str:
        """Return value and interval, each as a dash if it is missing."""
        value, low, high = (format(number, form) if np.isfinite(number) else "–" for number in self)
        return value if np.isnan(self.low) else f"{value} ({low} to {high})"


def successes(runs: pl.DataFrame, topic: str = "state") -> pl.DataFrame:
    """Return the rows of a topic of runs that did not fail."""
    return runs.filter(pl.col("topic") == topic)


def measured(runs: pl.DataFrame, topic: str, column: str) -> pl.Series:
    """Return a column of a topic's rows; without those where nobody was cut off, or nobody sent."""
    rows = successes(runs, topic)
    if column.startswith("recovery"):
        rows = rows.filter(pl.col("cut_pairs") > 0)
    return rows[column].drop_nulls() if column.startswith("delivery") else rows[column]


def draw(runs: Mapping[str, pl.DataFrame]) -> Any:
    """Draw a panel per measure: a dot per seed, and their median with its interval."""
    table = runs[CAMPAIGN]
    names, losses = table[NAME].unique(maintain_order=True).to_list(), sorted(table[LOSS].unique().to_list())
    figure = blank_figure(7.2, 6.6)
    for index, (column, topic, title, limits) in enumerate(PANELS):
        row, side = divmod(index, 2)
        axes = plain_axes(figure, (0.13 + 0.49 * side, 0.775 - 0.24 * row, 0.36, 0.17), title)
        axes.grid(visible=False, axis="y")
        for loss_index, loss in enumerate(losses):
            for y, name in enumerate(names):
                is_here = (pl.col(NAME) == name) & (pl.col(LOSS) == loss)
                values = measured(table.filter(is_here), topic, column).to_list()
                _draw_values(axes, y + 0.3 * (loss_index - 0.5), values, COLORS[loss], limits)
        axes.set_yticks(range(len(names)), names, fontsize=SMALL_PT)
        axes.set_ylim(len(names) - 0.4, -0.6)
        if limits is not None:
            axes.set_xlim(*limits)
        else:
            axes.set_xscale("log")
            axes.xaxis.set_major_formatter("{x:g}")
            axes.xaxis.set_minor_formatter("")
    for loss_index, loss in enumerate(losses):
        figure.text(0.4 + 0.15 * loss_index, 0.985, f"● loss {loss:g}", color=COLORS[loss], fontsize=SMALL_PT, va="top")
    return figure


def _draw_values(
    axes: Any, y: float, values: list[float | None], color: Any, limits: tuple[float, float] | None
) -> None:
    """Draw a dot for each value, a hollow one at the limit if it is missing, and the median with its interval."""
    known_values = [value for value in values if value is not None]
    axes.plot(known_values, [y] * len(known_values), "o", ms=2.6, color=color, alpha=0.7, mew=0)
    last = limits[1] if limits else max(known_values, default=0.0)
    missing = len(values) - len(known_values)
    axes.plot([last] * missing, [y] * missing, "o", ms=2.8, mfc="none", mec=color, mew=0.6, clip_on=False)
    median = Median.from_values(pl.Series(values, dtype=pl.Float64))
    if np.isfinite(median.low):
        axes.plot([median.low, min(median.high, last)], [y, y], color=color, lw=0.8)
    if np.isfinite(median.value):
        axes.plot([median.value] * 2, [y - 0.14, y + 0.14], color=color, lw=1.4)


def numbers(runs: Mapping[str, pl.DataFrame]) -> str:
    """Return a table of the steady time, one of discovery and the split, and one of cost; medians over seeds."""
    table = runs[CAMPAIGN]
    counted = successes(table)
    lines = [
        f"{counts(table, (NAME, LOSS))}\n"
        f"In the median run UDP's programs sent 99 % of their states at most {_median_ms(counted):.0f} ms late.",
        f"zenoh closed a transport over a message that it may not drop in\n{_closings(counted)}.",
    ]
    steady = {
        "states": ("state", "delivery_before", ".2f"),
        "maps": ("map", "delivery_before", ".2f"),
        "commands": ("command", "delivery_before", ".2f"),
        "latency p50, ms": ("state", "latency_p50_ms", ".0f"),
        "p95": ("state", "latency_p95_ms", ".0f"),
        "p99": ("state", "latency_p99_ms", ".0f"),
        "age, s": ("state", "age_mean_s", ".2f"),
        "age of map, s": ("map", "age_mean_s", ".2f"),
    }
    split = {
        "pairs found": ("state", "reach", ".2f"),
        "discovery p50, s": ("state", "discovery_p50_s", ".1f"),
        "last pair, s": ("state", "discovery_max_s", ".1f"),
        "states within a half": ("state", "delivery_within", ".2f"),
        "recovery p50, s": ("state", "recovery_p50_s", ".1f"),
        "last cut pair, s": ("state", "recovery_max_s", ".1f"),
        "commands across": ("command", "delivery_across", ".2f"),
        "states after": ("state", "delivery_after", ".2f"),
    }
    cost = {
        "frames/s": ("state", "frames_per_s", ".0f"),
        "kB/s": ("state", "kB_per_s", ".0f"),
        "airtime": ("state", "airtime", ".3f"),
        "out of range": ("state", "out_of_range_share", ".3f"),
        "lost": ("state", "lost_share", ".3f"),
        "collided": ("state", "collided_share", ".3f"),
    }
    titles = (
        "Before the split (20 to 30 s)",
        "Discovery, and the split (30 to 50 s)",
        "Cost over the whole run, and shares of frames' receivers by fate",
    )
    for title, columns in zip(titles, (steady, split, cost), strict=True):
        lines.append(f"{title}; {MEDIANS}:\n\n{_table(table, columns)}")
    lines.append(f"Differences between runs with the same seed, so the same motion; {MEDIANS}:\n\n{_pairs(table)}")
    return "\n\n".join(lines)


def _median_ms(counted: pl.DataFrame) -> float:
    """Return the median over UDP's runs of the lateness of its programs, which block in nothing; NaN without runs."""
    late_ms = counted.filter(pl.col(NAME) == "udp")["sent_late_p99_ms"].to_numpy()
    return float(np.median(late_ms)) if len(late_ms) else np.nan


def _closings(counted: pl.DataFrame) -> str:
    """Return in how many runs of each mode zenoh closed a transport (H6)."""
    modes = counted.filter(pl.col(NAME).str.starts_with("zenoh")).group_by(NAME, maintain_order=True)
    closings = modes.agg((pl.col("closings") > 0).sum().alias("runs"), pl.len().alias("all"))
    return ", ".join(f"{runs} of {total} runs of {name}" for name, runs, total in closings.iter_rows())


def _table(table: pl.DataFrame, columns: Mapping[str, tuple[str, str, str]]) -> str:
    table = table.with_columns((pl.col("discovered") / pl.col("pairs")).alias("reach"))
    rows: list[list[str]] = []
    for (name, loss), group in successes(table).group_by(NAME, LOSS, maintain_order=True):
        point = table.filter((pl.col(NAME) == name) & (pl.col(LOSS) == loss))
        cells = [
            Median.from_values(measured(point, topic, column)).text(form) for topic, column, form in columns.values()
        ]
        rows.append([str(name), f"{loss:g}", str(len(group)), *cells])
    return markdown(["middleware", "loss", "seeds", *columns], rows)


def _pairs(table: pl.DataFrame) -> str:
    """Return a table of the differences that the hypotheses are about."""
    rows: list[list[str]] = []
    for hypothesis, first, second, title, (topic, column, form) in DIFFERENCES:
        pairs = successes(table, topic).filter(pl.col(NAME) == first)
        others = successes(table, topic).filter(pl.col(NAME) == second)
        both = pairs.join(others, on=[LOSS, "seed"]).with_columns(
            (pl.col(column) - pl.col(f"{column}_right")).alias("difference")
        )
        for (loss,), group in both.drop_nulls("difference").group_by(LOSS, maintain_order=True):
            greater = str((group["difference"] > 0).sum())
            median = Median.from_values(group["difference"]).text(form)
            rows.append([hypothesis, f"{first} - {second}, {title}", f"{loss:g}", str(len(group)), greater, median])
    return markdown(["hypothesis", "difference", "loss", "seeds", "first is greater in", "median"], rows)


def counts(table: pl.DataFrame, keys: Sequence[str]) -> str:
    """Return how many runs count, of each point as `keys` tell them apart, why others do not, and the late frames."""
    failed, counted = table.filter(pl.col("ended") == "failed"), successes(table)
    seeds = counted.group_by(keys).len()["len"]
    low, high = seeds.min(), seeds.max()
    is_late, late_percent = failed["error"].cast(pl.String).str.starts_with("late"), 100.0 * counted["late"].to_numpy()
    failures = f" {len(failed)} failed,\n{is_late.sum()} of them since they were late." if len(failed) else ""
    return (
        f"{len(counted)} runs count, {low if low == high else f'{low} to {high}'} seeds of each point.{failures} "
        f"Of the frames of these runs,\n{np.median(late_percent):.2f} % were late (median), and "
        f"{late_percent.max():.2f} % at most."
    )

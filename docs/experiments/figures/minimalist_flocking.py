"""How long minimalist flocking takes until 60 and 80 % of a swarm are in one flock, by its size and by two readings.

Drawn as the share of runs that still wait; told as quartiles, with what was censored, beside efficiency, thresholds,
walls and motion.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.metrics.statistics.bootstrap import draw_counts, percentile_interval
from swarmwire.metrics.statistics.sample import Sample, number_sample, time_sample
from swarmwire.metrics.statistics.summary import interval_text, quartiles_text, summary
from swarmwire.metrics.statistics.survival import kaplan_meier, resampled_quantiles
from swarmwire.metrics.text import number_text

COUNT = "robots.swarm.count"
SEPARATION, LATERAL, REAR = (f"robots.swarm.params.{name}_diameters" for name in ("separation", "lateral", "rear"))
TIMES = {
    "hop_60_s": "60 %, one hop",
    "hop_80_s": "80 %, one hop",
    "cluster_60_s": "60 %, cluster",
    "cluster_80_s": "80 %, cluster",
}
MOTION = ("near_wall", "flock_speed_1", "flock_speed_2", "flock_speed_3", "flock_speed_4_up")
CAMPAIGNS = tuple(f"minimalist-{name}" for name in ("small", "large", "arena", "thresholds", "motion", "apart"))
LARGEST = {"aggregation_hop.max": "by one hop", "aggregation.max": "by clusters"}
COLUMNS = (*TIMES, *LARGEST, *(f"{name}.mean" for name in MOTION))
EVERYWHERE = ("run", "point", "seed", COUNT, SEPARATION, LATERAL, REAR, "stop_time_s", "sim_time_s")
RATE_HZ = 60
DENSE, SINGLE = "equal density", "one arena"


def digested(_folder: Path, runs: pl.DataFrame) -> pl.DataFrame:
    """What there is of the columns: campaigns of times and of motion measure different things."""
    return runs.select(name for name in (*EVERYWHERE, *COLUMNS, "timing_wall_s") if name in runs.columns)


def times(runs: pl.DataFrame, name: str) -> Sample:
    """The times of a criterion; where it was not met by the run's end it lies beyond that."""
    time_s = runs[name].to_numpy().astype(np.float64)
    observed = np.isfinite(time_s)
    ends_s = runs["sim_time_s"].to_numpy().astype(np.float64)
    return time_sample(np.where(observed, time_s, ends_s), observed, runs["seed"].to_numpy())


def swarms(runs: Mapping[str, pl.DataFrame]) -> dict[tuple[str, int], pl.DataFrame]:
    """The runs of each series and number of robots; five robots have the same arena in both."""
    dense = pl.concat([runs["minimalist-small"], runs["minimalist-large"]], how="diagonal")
    arena = pl.concat([runs["minimalist-small"].filter(pl.col(COUNT) == 5), runs["minimalist-arena"]], how="diagonal")
    tables = ((DENSE, dense), (SINGLE, arena))
    return {
        (series, n): table.filter(pl.col(COUNT) == n)
        for series, table in tables
        for n in sorted(table[COUNT].unique().to_list())
    }


def draw(runs: Mapping[str, pl.DataFrame]) -> Any:
    """Survival curves: a row for each series, a column for each share; full lines by one hop, dashed by clusters."""
    from swarmwire.metrics.pictures.drawing.canvas import INK, SOFT, TEXT_PT, plain_axes
    from swarmwire.metrics.pictures.report.axes import ordered_colors
    from swarmwire.metrics.pictures.report.page import blank_figure

    figure, groups = blank_figure(6.4, 4.4), swarms(runs)
    sizes = sorted({n for _, n in groups})
    color = dict(zip(sizes, ordered_colors(len(sizes)), strict=True))
    for row, series in enumerate((DENSE, SINGLE)):
        for column, share in enumerate((60, 80)):
            box = (0.08 + 0.47 * column, 0.58 - 0.47 * row, 0.4, 0.34)
            axes = plain_axes(figure, box, f"runs without {share} % in one flock, {series}")
            for (group_series, n), table in groups.items():
                for name, dashes in ((f"hop_{share}_s", "-"), (f"cluster_{share}_s", "--")):
                    if group_series == series:
                        time_s, waiting = curve(times(table, name))
                        axes.plot(
                            time_s, waiting, dashes, drawstyle="steps-post", color=color[n], lw=1.2, label=f"{n} robots"
                        )
            axes.set(xscale="log", xlim=(1.0, None), ylim=(0.0, 1.03))
            axes.set_xlabel("time, s", fontsize=TEXT_PT, color=SOFT, labelpad=2)
            if row == column == 0:
                handles, labels = axes.get_legend_handles_labels()
                axes.legend(
                    handles[::2], labels[::2], fontsize=TEXT_PT - 0.5, frameon=False, labelcolor=INK, loc="lower left"
                )
    figure.text(
        0.08,
        0.015,
        "full lines: one hop (Algorithm 1 to the letter); dashed: connected clusters",
        fontsize=TEXT_PT,
        color=SOFT,
    )
    return figure


def curve(sample: Sample) -> tuple[FloatArray, FloatArray]:
    """When the share of runs that wait falls, and what is left of it, up to the last run's end."""
    estimate, end_s = kaplan_meier(sample), float(sample.value.max())
    return np.array([1e-3, *estimate.time, end_s]), np.array([1.0, *estimate.survival, estimate.survival[-1]])


def numbers(runs: Mapping[str, pl.DataFrame]) -> str:
    """All tables, and what the runs took."""
    groups, swarm, criteria = swarms(runs), ("", "N", "runs"), tuple(TIMES.values())
    thresholds, moving = ("separation, lateral, rear", "runs"), ("N", "", "near a wall", "m/s alone", "in a flock of 2")
    tables = (
        ("Median time in s (quartiles); share of the runs censored", (*swarm, *criteria), quartiles(groups)),
        ("Runs that meet the criterion at t = 0", (*swarm, *criteria), chance(groups)),
        ("Largest flock of a run, in robots: median, and most", ("", "N", *LARGEST.values()), largest(groups)),
        ("Efficiency T(5) / T(N) at equal density (95 % interval)", ("N", *criteria), efficiency(groups)),
        ("Five robots by thresholds, as above", (*thresholds, *criteria), by_thresholds(runs[CAMPAIGNS[3]])),
        ("Walls and motion, means (95 % interval)", (*moving, "of 3", "of 4 and more"), motion(runs)),
    )
    costs = cost(pl.concat([runs[name] for name in CAMPAIGNS[:3]], how="diagonal"))
    return "\n\n".join((*(table(*content) for content in tables), costs))


def quartiles(groups: Mapping[tuple[str, int], pl.DataFrame]) -> list[list[str]]:
    """Of each swarm and criterion."""
    return [
        [series, str(n), str(len(group)), *(waits(times(group, name)) for name in TIMES)]
        for (series, n), group in groups.items()
    ]


def waits(sample: Sample) -> str:
    """Quartiles, and what is censored."""
    return f"{quartiles_text(summary(sample))}; {100 * sample.censored:.0f} %"


def chance(groups: Mapping[tuple[str, int], pl.DataFrame]) -> list[list[str]]:
    """What placement alone meets."""
    return [
        [
            series,
            str(n),
            str(len(group)),
            *(f"{100 * met_at_once(group, name):.1f} %" for name in TIMES),
        ]
        for (series, n), group in groups.items()
    ]


def met_at_once(runs: pl.DataFrame, name: str) -> float:
    """The share of the runs that begin with the criterion met."""
    return len(runs.filter(pl.col(name) == 0.0)) / len(runs)


def largest(groups: Mapping[tuple[str, int], pl.DataFrame]) -> list[list[str]]:
    """The largest flock that a run ever had, in robots: median over runs, and the largest of all."""
    rows: list[list[str]] = []
    for (series, n), group in groups.items():
        robots = [group[name].cast(pl.Float64).to_numpy() * n for name in LARGEST]
        rows.append([series, str(n), *(f"{np.median(most):.0f}, {np.max(most):.0f}" for most in robots)])
    return rows


def efficiency(groups: Mapping[tuple[str, int], pl.DataFrame]) -> list[list[str]]:
    """Of each larger swarm at equal density against the smallest."""
    sizes = sorted(n for series, n in groups if series == DENSE)
    first = groups[DENSE, sizes[0]]
    return [[str(n), *(ratio(times(first, name), times(groups[DENSE, n], name)) for name in TIMES)] for n in sizes[1:]]


def ratio(first: Sample, other: Sample) -> str:
    """The ratio of medians; of a median beyond the limit only what it is at most can be told."""
    medians = [summary(sample).q50 for sample in (first, other)]
    if np.isnan(medians[0]):
        return "–"
    if np.isnan(medians[1]):
        return f"< {number_text(medians[0] / float(other.value.max()))}"
    drawn_medians = [
        resampled_quantiles(sample, draw_counts(len(sample), at), 0.5) for at, sample in enumerate((first, other))
    ]
    if np.isinf(drawn_medians[0]).any():
        return number_text(medians[0] / medians[1])
    spread = drawn_medians[0] / np.maximum(drawn_medians[1], 1e-9)
    interval = percentile_interval(spread, min(len(first), len(other)))
    return f"{number_text(medians[0] / medians[1])} ({interval_text(interval)})"


def by_thresholds(runs: pl.DataFrame) -> list[list[str]]:
    """Quartiles of five robots."""
    rows: list[list[str]] = []
    for (separation, lateral, rear), group in runs.group_by(SEPARATION, LATERAL, REAR, maintain_order=True):
        rows.append(
            [f"{separation:g}, {lateral:g}, {rear:g}", str(len(group)), *(waits(times(group, name)) for name in TIMES)]
        )
    return sorted(rows)


def motion(runs: Mapping[str, pl.DataFrame]) -> list[list[str]]:
    """Share near walls, and the speed of flocks by size, with and without cohesion."""
    rows: list[list[str]] = []
    for name, rule in (("minimalist-motion", "all rules"), ("minimalist-apart", "no cohesion")):
        for (n,), group in runs[name].group_by(COUNT, maintain_order=True):
            means = (summary(number_sample(group[f"{measure}.mean"].cast(pl.Float64).to_numpy())) for measure in MOTION)
            rows.append(
                [
                    str(n),
                    rule,
                    *(
                        f"{number_text(statistics.mean)} ({interval_text(statistics.mean_interval)})"
                        for statistics in means
                    ),
                ]
            )
    return rows


def cost(runs: pl.DataFrame) -> str:
    """What it took, in one line."""
    steps = float((runs["sim_time_s"] * runs[COUNT]).sum()) * RATE_HZ
    wall_s = float(runs["timing_wall_s"].sum())
    done = (
        f"{len(runs)} runs of times: {steps / 1e6:.0f} million robot-steps in {wall_s / 60:.0f} minutes of one worker"
    )
    return f"{done}, {steps / wall_s / 1e6:.2f} million a second."


def table(title: str, head: tuple[str, ...], rows: list[list[str]]) -> str:
    """A Markdown table under its title."""
    lines = [head, ["---"] * len(head), *rows]
    return f"**{title}**\n\n" + "\n".join(f"| {' | '.join(cells)} |" for cells in lines)

"""Vicsek's model: order against noise, beside numbers of other programs and the exact case of all to all."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import polars as pl

from docs.experiments.figures._side_by_side import legend, mean_and_interval, means, panels, table, within
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.metrics.pictures.drawing.canvas import ACCENT, CURVE, SOFT
from swarmwire.metrics.statistics.sample import Interval

CAMPAIGNS = ("vicsek", "vicsek-long", "vicsek-all", "vicsek-512")
COLUMNS = ("order.late",)  # mean over the part of each run that is not burn-in

NOISE = "robots.particles.params.noise_rad"
# Share of a run that is left out.
BURN_IN = {"vicsek": 1 / 3, "vicsek-long": 2 / 3, "vicsek-all": 0.1, "vicsek-512": 1 / 3}
# Mean orders by another hand: a program in C++ written apart from this project's code, burn-in 20,000 steps or more.
OTHER_PROGRAM = {"vicsek": {1.0: 0.954, 3.0: 0.621}, "vicsek-512": {0.24: 0.645, 0.28: 0.534, 0.32: 0.378}}
ROBOTS = 100
LARGE = "N = 512, density 1, 0.1 a step"
HEAD = ("case", "noise [rad]", "runs", "order", "expected", "by")


class Row(NamedTuple):
    """A line of the table."""

    case: str
    noise: str
    value: FloatArray  # (runs,)
    expected: float | None
    by: str

    @property
    def measured(self) -> tuple[float, Interval]:
        """The mean and its interval."""
        return mean_and_interval(self.value)

    @property
    def texts(self) -> list[str]:
        """The cells."""
        expected = "" if self.expected is None else f"{self.expected:.4f}".rstrip("0")
        return [self.case, self.noise, str(len(self.value)), within(*self.measured, 4), expected, self.by]


def digested(folder: Path, runs: pl.DataFrame) -> pl.DataFrame:
    """The mean order of each run after its burn-in."""
    burn_in = BURN_IN[folder.name]
    series = pl.scan_parquet(folder / "series" / "*.parquet").select("run", "tick", pl.col("order").cast(pl.Float64))
    late = series.join(runs.lazy().select("run", "ticks"), on="run").filter(pl.col("tick") >= burn_in * pl.col("ticks"))
    order = late.group_by("run").agg(pl.col("order").mean().alias("order.late")).collect()
    columns = ("run", "point", "seed", NOISE, "ended", "sim_time_s", *COLUMNS, "timing_wall_s")
    return runs.join(order, on="run", how="left", maintain_order="left").select(columns)


def all_to_all(noise_rad: FloatArray | float, robots: int | None = None) -> Any:
    """The mean order where all hear all: sin(eta / 2) / (eta / 2), and for so many robots more, to the order of 1 / N.

    Each is off the one direction by its own noise. The sum along it grows as N, across it as the root of N, so that the
    length of both is on average longer by the variance across, over twice the length along.
    """
    along = np.sinc(np.asarray(noise_rad) / (2.0 * np.pi))
    if robots is None:
        return along
    return along + (1.0 - np.sinc(np.asarray(noise_rad) / np.pi)) / (4.0 * robots * along)


def draw(runs: Mapping[str, pl.DataFrame]) -> Any:
    """Order against noise: the paper's density, and all to all."""
    figure, (near, far) = panels(
        ("order, N = 100, density 4", "noise η [rad]"), ("order, all hear all, N = 100", "noise η [rad]")
    )
    noise, values = _by_noise(runs["vicsek"])
    means(near, noise, values, color=CURVE, label="here")
    other_program = OTHER_PROGRAM["vicsek"]
    near.plot(
        list(other_program),
        list(other_program.values()),
        "x",
        color=ACCENT,
        ms=6,
        mew=1.2,
        label="another program",
        zorder=5,
    )
    near.axhline(np.sqrt(np.pi / (4.0 * ROBOTS)), color=SOFT, lw=0.7, ls="--", label="headings at random")
    legend(near, loc="upper right")  # clear of the dashed line
    noise, values = _by_noise(runs["vicsek-all"])
    fine = np.linspace(0.1, 5.2, 200)
    far.plot(fine, all_to_all(fine), color=SOFT, lw=0.8, ls="--", label="exact, N → ∞")
    far.plot(fine, all_to_all(fine, ROBOTS), color=ACCENT, lw=0.9, label="with 1/N")
    means(far, noise, values, color=CURVE, label="here", ls="")
    legend(far, loc="lower left")
    for axes in (near, far):
        axes.set_ylim(0.0, 1.02)
    return figure


def numbers(runs: Mapping[str, pl.DataFrame]) -> str:
    """Every noise with its order and what it should be, where that is known."""
    rows = _rows(runs)
    alike = [row for row in rows if row.expected is not None and row.case != LARGE]
    off = [abs(row.measured[0] - (row.expected or 0.0)) for row in alike]
    head = "Means over runs and over the steps after the burn-in; 95 % intervals over runs.\n\n"
    worst = f"\n\nOf the {len(off)} orders that are known for this model, none is off by more than {max(off):.4f}."
    return head + table(HEAD, [row.texts for row in rows]) + worst


def _rows(runs: Mapping[str, pl.DataFrame]) -> list[Row]:
    rows: list[Row] = []
    for campaign, case in (("vicsek", "N = 100, L = 5"), ("vicsek-long", "the same, long")):
        for noise, value in zip(*_by_noise(runs[campaign]), strict=True):
            expected = OTHER_PROGRAM["vicsek"].get(noise)
            rows.append(Row(case, f"{noise:g}", value, expected, "" if expected is None else "another program"))
    for noise, value in zip(*_by_noise(runs["vicsek-all"]), strict=True):
        rows.append(Row("all hear all", f"{noise:g}", value, float(all_to_all(noise, ROBOTS)), "formula, with 1/N"))
    for noise, value in zip(*_by_noise(runs["vicsek-512"]), strict=True):
        turn = round(noise / (2.0 * np.pi), 2)
        expected = OTHER_PROGRAM["vicsek-512"].get(turn)
        rows.append(Row(LARGE, f"{turn:g} x 2π", value, expected, "another program: moves by the new direction"))
    return rows


def _by_noise(runs: pl.DataFrame) -> tuple[list[float], list[FloatArray]]:
    """Noises, rising, and the late orders of each."""
    noise: list[float] = []
    values: list[FloatArray] = []
    for (key,), at in runs.sort(NOISE, "seed").group_by(NOISE, maintain_order=True):
        noise.append(float(str(key)))
        values.append(at["order.late"].drop_nulls().to_numpy())
    return noise, values

"""Dense flocks: order, speed and throughput against density, and where a flock freezes."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from docs.experiments.figures._side_by_side import legend, mean_and_interval, means, panels, table, within
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.metrics.pictures.drawing.canvas import ACCENT, CURVE, SOFT
from swarmwire.metrics.statistics.trends import ChangePoint, change_point

CAMPAIGNS = ("dense", "dense-box", "dense-box-coarse")
MEASURED = ("order", "order_local", "rotation", "speed", "deadlocked")
COLUMNS = ("flow_per_min", *MEASURED)  # over the second half of each run

COUNT, STEPS = "robots.flock.count", "physics.steps"
FLOOR_M2 = {"dense": 1.2**2 - np.pi * 0.25**2, "dense-box": 1.0, "dense-box-coarse": 1.0}
BURN_IN = 0.5  # share of a run that is left out
STILL_MPS = 0.001  # mean speed below which a swarm is frozen: a hundredth of what its robots would go
FINE, COARSE = 20, 5  # physics steps per tick
RING = ("robots", "covered", "flow [1/min]", "flow, coarse", "speed [m/s]", "speed, coarse", "rotation", "order")
BOX = ("robots", "covered", "speed [m/s]", "speed, coarse", "order", "local order", "deadlocked")


def digested(folder: Path, runs: pl.DataFrame) -> pl.DataFrame:
    """Means over the second half of each run, and how many robots a minute pass the gate, one way less the other."""
    series = pl.scan_parquet(folder / "series" / "*.parquet").join(
        runs.lazy().select("run", "ticks", "sim_time_s"), on="run"
    )
    late = series.filter(pl.col("tick") >= BURN_IN * pl.col("ticks")).fill_nan(None)
    minutes = pl.col("sim_time_s").first() * (1.0 - BURN_IN) / 60.0
    flow = (_last_less_first(pl.col("gate").cast(pl.Float64)).abs() / minutes).alias("flow_per_min")
    means = late.group_by("run").agg(flow, *(pl.col(name).cast(pl.Float64).mean() for name in MEASURED)).collect()
    varied = [name for name in (STEPS, COUNT) if name in runs.columns]
    columns = ("run", "point", "seed", *varied, "ended", "sim_time_s", *COLUMNS, "timing_wall_s")
    return runs.join(means, on="run", how="left", maintain_order="left").select(columns)


def _last_less_first(total: pl.Expr) -> pl.Expr:
    """What was added to a count, of which series hold the total so far."""
    return total.sort_by("tick").last() - total.sort_by("tick").first()


def covered(count: FloatArray | int, campaign: str) -> Any:
    """Share of the floor that so many e-pucks cover."""
    return np.asarray(count) * np.pi * load_body("epuck").radius_m ** 2 / FLOOR_M2[campaign]


def draw(runs: Mapping[str, pl.DataFrame]) -> Any:
    """Flow in the ring; speed and order in the box."""
    figure, (flow, speed, order) = panels(
        ("robots a minute through the gate of the ring", "share of the floor covered"),
        ("mean speed in the box, m/s", "share of the floor covered"),
        ("order in the box", "share of the floor covered"),
    )
    ring = runs["dense"]
    for steps, look in ((FINE, CURVE), (COARSE, ACCENT)):
        _curve(flow, ring.filter(pl.col(STEPS) == steps), "dense", "flow_per_min", look, f"{steps} steps a tick")
    for campaign, look, steps in (("dense-box", CURVE, FINE), ("dense-box-coarse", ACCENT, COARSE)):
        _curve(speed, runs[campaign], campaign, "speed", look, f"{steps} steps a tick")
    jump = frozen(runs["dense-box"], "dense-box")
    if jump is not None:
        speed.axvspan(*jump.position_interval, color=SOFT, alpha=0.2, lw=0)
        speed.axvline(jump.position, color=SOFT, lw=0.8, ls="--")
    _curve(order, runs["dense-box"], "dense-box", "order", CURVE, "of all")
    _curve(order, runs["dense-box"], "dense-box", "order_local", SOFT, "with neighbours")
    for axes in (flow, speed, order):
        axes.set_ylim(bottom=0.0)
        legend(axes, loc="best")
    return figure


def frozen(runs: pl.DataFrame, campaign: str) -> ChangePoint | None:
    """Where runs freeze: the step along what is covered of the share of runs whose robots stand still."""
    counts, values = _by_count(runs, "speed")
    still = (np.array(values) < STILL_MPS).astype(np.float64)
    return change_point(covered(np.array(counts), campaign), still)


def numbers(runs: Mapping[str, pl.DataFrame]) -> str:
    """Tables of ring and box, and where the box freezes."""
    ring = runs["dense"]
    fine, coarse = (ring.filter(pl.col(STEPS) == steps) for steps in (FINE, COARSE))
    rows = [
        [str(count), f"{covered(count, 'dense'):.2f}", *cells]
        for count, *cells in zip(
            _by_count(fine, "speed")[0],
            *(
                _cells(ring_runs, name, digits)
                for ring_runs, name, digits in (
                    (fine, "flow_per_min", 1),
                    (coarse, "flow_per_min", 1),
                    (fine, "speed", 3),
                    (coarse, "speed", 3),
                    (fine, "rotation", 2),
                    (fine, "order", 2),
                )
            ),
            strict=True,
        )
    ]
    return "\n\n".join(
        (
            f"The ring, {_seeds(ring)} runs a row; coarse: {COARSE} physics steps a tick in place of {FINE}.",
            table(RING, rows),
            f"The box, {_seeds(runs['dense-box'])} runs a row.",
            table(BOX, _box(runs)),
            *(
                _jump_text(runs[campaign], campaign, steps)
                for campaign, steps in (("dense-box", FINE), ("dense-box-coarse", COARSE))
            ),
        )
    )


def _box(runs: Mapping[str, pl.DataFrame]) -> list[list[str]]:
    fine, coarse = runs["dense-box"], runs["dense-box-coarse"]
    coarse_speeds = dict(zip(_by_count(coarse, "speed")[0], _cells(coarse, "speed", 4), strict=True))
    counts = _by_count(fine, "speed")[0]
    columns = [
        _cells(fine, name, digits)
        for name, digits in (("speed", 4), ("order", 2), ("order_local", 2), ("deadlocked", 3))
    ]
    return [
        [str(count), f"{covered(count, 'dense-box'):.2f}", speed, coarse_speeds.get(count, ""), *cells]
        for count, speed, *cells in zip(counts, *columns, strict=True)
    ]


def _jump_text(runs: pl.DataFrame, campaign: str, steps: int) -> str:
    jump = frozen(runs, campaign)
    if jump is None:
        return f"With {steps} physics steps a tick all runs are alike: none is frozen, or all are."
    (low, high), limit = jump.position_interval, f"{1000.0 * STILL_MPS:g} mm/s"
    return (
        f"With {steps} physics steps a tick, runs freeze (mean speed below {limit}) at {jump.position:.3f} of the "
        f"floor: {abs(jump.below):.0%} of them up to {jump.after:.3f}, {jump.above:.0%} from {jump.before:.3f} on; "
        f"95 % interval of the change point {low:.3f} to {high:.3f}, in steps of the densities tried."
    )


def _curve(axes: Any, runs: pl.DataFrame, campaign: str, column: str, color: Any, label: str) -> None:
    counts, values = _by_count(runs, column)
    means(axes, covered(np.array(counts), campaign), values, color=color, label=label)


def _cells(runs: pl.DataFrame, column: str, digits: int) -> list[str]:
    return [within(*mean_and_interval(value), digits) for value in _by_count(runs, column)[1]]


def _by_count(runs: pl.DataFrame, column: str) -> tuple[list[int], list[FloatArray]]:
    """Numbers of robots, rising, and the values of the runs of each, by seed."""
    counts: list[int] = []
    values: list[FloatArray] = []
    for (count,), at in runs.sort(COUNT, "seed").group_by(COUNT, maintain_order=True):
        counts.append(int(str(count)))
        values.append(at[column].to_numpy())
    return counts, values


def _seeds(runs: pl.DataFrame) -> int:
    return runs["seed"].n_unique()

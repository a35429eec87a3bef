"""What a report of a large campaign takes: time and memory of the command, in a process of its own."""

import os
import statistics
import subprocess
import sys
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import polars as pl

from benchmarks.lines import print_line, spread
from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.base.draws import derive_key, purpose, uniform
from swarmwire.metrics.records.campaign import campaign_json
from swarmwire.metrics.records.campaign.campaign_json import Campaign, Response

LOSSES = tuple(index / 20 for index in range(10))
COUNTS = (5, 10, 20, 40, 80)
LIMIT_S = 600.0
METRICS = ("order", "largest_component", "min_gap", "collisions", "target_best", "target_mean", "components")
TIMES = ("aggregation_time_s", "stop_time_s")


def report_cost(name: str, repeats: int, *, seeds: int) -> None:
    """Seconds from the call to the end, imports included, and the most memory that the process held."""
    clock = WallClock()
    taken_s, most_mb, size_mb = list[float](), list[float](), 0.0
    with TemporaryDirectory() as folder:
        runs = write_campaign(Path(folder), seeds)
        for _ in range(repeats):
            start_ns = clock.now_ns()
            process = subprocess.Popen(
                [sys.executable, "-m", "swarmwire.deploy", "report", folder], stdout=subprocess.DEVNULL
            )
            _, status, usage = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
            if process.returncode != 0:
                raise RuntimeError("no report was made: its cost says nothing")
            taken_s.append((clock.now_ns() - start_ns) / 1e9)
            most_mb.append(usage.ru_maxrss / 1e3)
        size_mb = Path(folder, "report.html").stat().st_size / 1e6
    config = {"points": len(LOSSES) * len(COUNTS), "runs": runs, "responses": len(METRICS) + len(TIMES) + 1}
    details = {**config, "page_mb": round(size_mb, 1)}
    print_line(name, statistics.median(taken_s), "s", {**details, **spread(taken_s)})
    print_line(f"{name}-memory", statistics.median(most_mb), "MB", {**details, **spread(most_mb)})


def write_campaign(folder: Path, seeds: int) -> int:
    """Write a campaign with made-up responses over loss and number of robots; the number of its runs."""
    points: list[tuple[float, int]] = list(product(LOSSES, COUNTS))
    run = np.arange(len(points) * seeds)
    point, seed = run // seeds, run % seeds + 1
    loss, count = (np.array(values, dtype=np.float64)[point] for values in zip(*points, strict=True))
    link_pdr = np.clip(1.0 - loss + 0.02 * _drawn(run, "link_pdr"), 0.0, 1.0)
    columns: dict[str, Any] = {"run": run, "point": point, "seed": seed, "radio.loss": loss}
    columns |= {"robots.flock.count": count.astype(np.int64), "ended": ["duration"] * len(run)}
    columns |= {"sim_time_s": np.full(len(run), LIMIT_S), "radio.link_pdr": link_pdr}
    for index, metric in enumerate(METRICS):
        columns[f"{metric}.final"] = (1 + index) / (1.0 + np.exp(20.0 * loss - 4.0)) + 0.1 * _drawn(run, metric)
    for time in TIMES:
        time_s = -100.0 * (1.0 + 8.0 * loss) * (20.0 / count) ** 0.5 * np.log(1.0 - _drawn(run, time))
        columns[time] = [value if value < LIMIT_S else None for value in time_s.tolist()]
    pl.DataFrame(columns).write_parquet(folder / "summary.parquet")
    campaign_json.write_campaign(_about(points, seeds), folder)
    return len(run)


def _drawn(run: IntArray, name: str) -> FloatArray:
    return uniform(derive_key("report-cost"), purpose(name), 0, run, 0)


def _about(points: list[tuple[float, int]], seeds: int) -> Campaign:
    numbers = [*(f"{metric}.final" for metric in METRICS), "radio.link_pdr"]
    responses = [Response(column, "", "number", "made up") for column in numbers]
    responses += [Response(column, "s", "time", "made up") for column in TIMES]
    return Campaign(
        scenario="made up",
        command="none",
        began_utc="",
        versions={},
        cpu="",
        modules={},
        files=(),
        name="made up",
        design="grid",
        seeds=tuple(range(1, seeds + 1)),
        vary={"radio.loss": list(LOSSES), "robots.flock.count": list(COUNTS)},
        points=tuple({"radio.loss": loss, "robots.flock.count": count} for loss, count in points),
        overrides=(),
        point_overrides=((),) * len(points),
        duration_s=LIMIT_S,
        robots=max(COUNTS),
        responses=tuple(responses),
        series=False,
        record_seeds=(),
        batch=None,
        realtime=None,
        max_late=0.01,
    )

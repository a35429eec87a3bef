"""Campaign folders with numbers that a test makes up, written as the real ones are."""

import itertools
import json
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

Make = Callable[[Mapping[str, Any], np.random.Generator], float | None]  # (point, draws of the run) -> value

LIMIT_S = 100.0
RATE_HZ = 10.0


def order(point: Mapping[str, Any], rng: np.random.Generator) -> float:
    """Falls with loss, 0 to 1."""
    return float(np.clip(0.95 - 0.6 * point.get("radio.loss", 0.0) + 0.05 * rng.standard_normal(), 0.0, 1.0))


def aggregation_time_s(point: Mapping[str, Any], rng: np.random.Generator) -> float | None:
    """Longer with loss, censored at the limit."""
    time_s = rng.exponential(20.0 * (1.0 + 4.0 * point.get("radio.loss", 0.0)))
    return float(time_s) if time_s < LIMIT_S else None


NUMBERS: dict[str, Make] = {
    "order.final": order,
    "order.mean": order,
    "order.min": order,
    "order.max": order,
    "radio.link_pdr": lambda point, _: 1.0 - point.get("radio.loss", 0.0),
    "counts.late_answers": lambda _, rng: float(rng.poisson(2.0)),
}
TIMES: dict[str, Make] = {"aggregation_time_s": aggregation_time_s}


def write_campaign(
    folder: Path,
    vary: Mapping[str, Sequence[Any]] | None = None,
    seeds: Sequence[int] = tuple(range(1, 11)),
    *,
    numbers: Mapping[str, Make] = NUMBERS,
    times: Mapping[str, Make] = TIMES,
    points: Sequence[Mapping[str, Any]] | None = None,
    design: str = "grid",
    name: str = "loss",
    limit_s: float = LIMIT_S,
    failed: Collection[int] = (),
    missing: Collection[int] = (),
    stopped: Mapping[int, float] | None = None,
    parts: int = 0,
    draws: int = 0,
) -> Path:
    """Write a campaign's folder and return its path.

    Every parameter's every value is met with every other's, unless `points` are given. `failed` and `missing` are
    numbers of runs, `stopped` of those that a stop condition ended, with the time in s. With `parts` the rows stand in
    so many files, as of a running campaign. What a run draws belongs to `draws` and to the run's number. A time is
    null where it is None or beyond `limit_s`.
    """
    varied = {"radio.loss": [0.0, 0.2, 0.4]} if vary is None else dict(vary)
    if points is None:
        points = [dict(zip(varied, values, strict=True)) for values in itertools.product(*varied.values())]
    folder.mkdir(parents=True, exist_ok=True)
    about = _about(name, design, varied, points, seeds, numbers, times, limit_s)
    (folder / "campaign.json").write_text(json.dumps(about, indent=2))
    (folder / "scenario").mkdir()
    (folder / "scenario" / "scenario.toml").write_text(f'name = "{name}"\n')
    stops = stopped or {}
    rows: list[dict[str, Any]] = [
        _row(run, point, seed, numbers, times, stops.get(run, limit_s), failed=run in failed, draws=draws)
        | ({"ended": "stopped"} if run in stops else {})
        for run, (point, seed) in enumerate(itertools.product(points, seeds))
    ]
    frame = pl.DataFrame(
        [row | {"point": row["run"] // len(seeds)} for row in rows if row["run"] not in missing],
        schema=_schema(points, numbers, times),
    )
    if parts:
        (folder / "parts").mkdir()
        for part in range(parts):
            frame[part::parts].write_parquet(folder / "parts" / f"part-{part:06d}.parquet")
    else:
        frame.write_parquet(folder / "summary.parquet")
    return folder


def _about(
    name: str,
    design: str,
    varied: Mapping[str, Sequence[Any]],
    points: Sequence[Mapping[str, Any]],
    seeds: Sequence[int],
    numbers: Mapping[str, Make],
    times: Mapping[str, Make],
    limit_s: float,
) -> dict[str, Any]:
    """campaign.json."""
    responses = [
        {"column": column, "unit": unit, "kind": kind, "help": f"made-up {column}", "listed": False, "hold_s": 0.0}
        for columns, unit, kind in ((numbers, "", "number"), (times, "s", "time"))
        for column in columns
    ]
    return {
        "format": 1,
        "name": name,
        "scenario": name,
        "command": f"swarmwire sweep {name}.toml",
        "began_utc": "2024-05-01T12:00:00Z",
        "versions": {"python": "3.11.9", "swarmwire": "0.1.0"},
        "cpu": "made-up CPU",
        "modules": {},
        "files": [{"path": "scenario.toml", "sha256": "", "what": "scenario"}],
        "design": design,
        "seeds": list(seeds),
        "vary": {path: list(values) for path, values in varied.items()},
        "points": [dict(point) for point in points],
        "overrides": [],
        "point_overrides": [[] for _ in points],
        "duration_s": limit_s,
        "robots": 10,
        "responses": responses,
        "series": False,
        "record_seeds": [],
        "batch": None,
        "realtime": None,
        "max_late": 0.01,
    }


def _row(
    run: int,
    point: Mapping[str, Any],
    seed: int,
    numbers: Mapping[str, Make],
    times: Mapping[str, Make],
    limit_s: float,
    *,
    failed: bool,
    draws: int,
) -> dict[str, Any]:
    rng = np.random.default_rng([draws, run])
    outcome: dict[str, Any] = {column: make(point, rng) for column, make in numbers.items()}
    for column, make in times.items():
        time_s = make(point, rng)
        outcome[column] = time_s if time_s is not None and time_s <= limit_s else None
    ticks = int(limit_s * RATE_HZ)
    row: dict[str, Any] = {"run": run, "seed": seed, **point, "timing_wall_s": 0.5, "machine_cpu": "made-up CPU"}
    row |= {"machine_host": "here", "machine_worker": 0}
    if failed:
        return row | {"ended": "failed", "error": "the agent of flock-0 failed"}
    return (
        row | outcome | {"ended": "duration", "ticks": ticks, "sim_time_s": limit_s, "trajectory_sha256": f"{run:064x}"}
    )


def _schema(
    points: Sequence[Mapping[str, Any]], numbers: Mapping[str, Make], times: Mapping[str, Make]
) -> dict[str, Any]:
    varied = {path: pl.Series([point[path] for point in points]).dtype for path in points[0]}
    start = {"run": pl.Int64, "point": pl.Int64, "seed": pl.Int64, **varied, "ended": pl.String, "error": pl.String}
    middle = {"ticks": pl.Int64, "sim_time_s": pl.Float64, "trajectory_sha256": pl.String}
    measured = dict.fromkeys([*numbers, *times], pl.Float64)
    machine = {"machine_cpu": pl.String, "machine_host": pl.String, "machine_worker": pl.Int64}
    return {**start, **middle, **measured, "timing_wall_s": pl.Float64, **machine}

"""Experiments in miniature, and the Vicsek model as its paper has it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numba import njit

from docs.experiments.experiment import LAYOUT, Experiment, find_experiment
from docs.experiments.making import digest_of
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.draws import derive_key, purpose, uniform
from swarmwire.deploy.campaigns.design import vary_from
from swarmwire.deploy.campaigns.spec import campaign_file, plan_of, spec_in
from swarmwire.deploy.campaigns.sweep import ExecutionOptions, begin_sweep
from swarmwire.deploy.runs.config import seed_list
from tests.support.deploy.campaign import InThisProcess

POSITION, NOISE = purpose("place"), purpose("noise")


@dataclass(frozen=True)
class Miniature:
    """What came of it."""

    runs: Mapping[str, pl.DataFrame]  # digests by campaign
    figure: Any
    numbers: str


def miniature(
    name: str,
    folder: Path,
    *,
    seeds: int | Sequence[int],
    vary: Mapping[str, Any] | None = None,
    overrides: Sequence[str] = (),
    campaigns: Sequence[str] | None = None,
) -> Miniature:
    """The experiment with these seeds, and by path other values of what its campaign files vary.

    `overrides` are for all its campaigns. With `campaigns` only these are run, and nothing is drawn or told. No run may
    fail.
    """
    experiment = find_experiment(name, LAYOUT)
    selected = experiment.campaigns if campaigns is None else campaigns
    runs = {campaign: _digest(experiment, campaign, folder, seeds, vary or {}, overrides) for campaign in selected}
    if campaigns is not None:
        return Miniature(runs, None, "")
    return Miniature(runs, experiment.draw(runs), experiment.numbers(runs))


def _digest(
    experiment: Experiment,
    campaign: str,
    folder: Path,
    seeds: int | Sequence[int],
    vary: Mapping[str, Any],
    overrides: Sequence[str],
) -> pl.DataFrame:
    file = LAYOUT.campaigns / f"{campaign}.toml"
    table = campaign_file(file)
    assert table is not None, file
    spec = replace(spec_in(file, table), seeds=seed_list(seeds))
    varied = tuple(
        vary_from(axis.path, vary[axis.path], axis.path) if axis.path in vary else axis for axis in spec.varied
    )
    plan = plan_of(replace(spec, varied=varied, overrides=(*spec.overrides, *overrides)))
    done = begin_sweep(plan, folder / campaign, "a miniature", ExecutionOptions(executor=InThisProcess(1)))
    assert done.is_over
    assert not done.failed
    return digest_of(experiment, folder / campaign)


# pyright: basic, reportUnknownMemberType=false


def mean_order(
    robots: int, side: float, way: float, noise_rad: float, steps: tuple[int, int], *, new: bool, seed: int
) -> float:
    """The mean order of a run, between the first and the last of `steps`; range 1, `way` a step."""
    key, index = derive_key("reference", seed), np.arange(robots)
    x, y, turn = (uniform(key, axis, index, 0, POSITION) for axis in range(3))
    x, y, theta = side * x, side * y, 2.0 * np.pi * turn
    orders: list[float] = []
    for step in range(steps[1]):
        noise = noise_rad * (uniform(key, step, index, 0, NOISE) - 0.5)
        turned = mean_direction(x, y, theta, side) + noise
        go = turned if new else theta
        x, y, theta = (x + way * np.cos(go)) % side, (y + way * np.sin(go)) % side, turned
        if step >= steps[0]:
            orders.append(float(np.hypot(np.cos(theta).mean(), np.sin(theta).mean())))
    return float(np.mean(orders))


@njit(cache=True)
def mean_direction(x: FloatArray, y: FloatArray, theta: FloatArray, side: float) -> FloatArray:
    """Of all within 1 of each, itself included, on a torus; (n,) each. Cells of at least 1, three in a row or more."""
    cells = int(side)
    first, after = np.full((cells, cells), -1), np.empty(len(x), np.int64)
    column = np.minimum((x * (cells / side)).astype(np.int64), cells - 1)
    row = np.minimum((y * (cells / side)).astype(np.int64), cells - 1)
    for i in range(len(x)):
        after[i] = first[row[i], column[i]]
        first[row[i], column[i]] = i
    c, s, mean = np.cos(theta), np.sin(theta), np.empty(len(x))
    for i in range(len(x)):
        along, across = 0.0, 0.0
        for cell in range(9):
            k = first[(row[i] + cell // 3 - 1) % cells, (column[i] + cell % 3 - 1) % cells]
            while k >= 0:
                dx, dy = x[k] - x[i], y[k] - y[i]
                dx, dy = dx - side * np.round(dx / side), dy - side * np.round(dy / side)
                if dx * dx + dy * dy <= 1.0:
                    along += c[k]
                    across += s[k]
                k = after[k]
        mean[i] = np.arctan2(across, along)
    return mean

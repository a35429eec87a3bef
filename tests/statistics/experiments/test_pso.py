"""The experiments with particle swarm search in small: swept, digested, drawn and told."""

import polars as pl
import pytest

from docs.experiments.figures._pso_samples import mean_distances
from tests.support.experiments.miniature import miniature

SMALL = [
    "duration_s=60",
    "arena.size_m=[4, 4]",
    "arena.lights.0.intensity=2.3",
    "robots.particles.params.update_every_ticks=40",
]
FEW_POINTS = {
    "radio.loss": [0.0, 0.8],
    "radio.latency_s": [0.0, 5.0],
    "robots.particles.params.inertia": [0.6, 0.8],
}


@pytest.mark.slow
@pytest.mark.parametrize(("name", "panels", "tables"), [("pso", 6, 8), ("pso-why", 1, 2)])
def test_all_campaigns_come_to_a_figure_and_numbers(tmp_path, name, panels, tables):
    short = [*SMALL, "duration_s=20"]
    of = miniature(name, tmp_path, seeds=1, vary={**FEW_POINTS, "radio.range_m": [2.0, 12.0]}, overrides=short)
    assert len(of.figure.axes) == panels
    assert of.told.count("\n\n| ") == tables


@pytest.mark.parametrize("campaign", ["pso-range", "pso-range-model"])
def test_those_who_hear_one_another_find_the_light_and_come_nearer(tmp_path, campaign):
    of = miniature("pso", tmp_path, seeds=4, vary={"radio.range_m": [0.1, 12.0]}, overrides=SMALL, campaigns=[campaign])
    deaf, received = (of.runs[campaign].filter(pl.col("radio.range_m") == range_m) for range_m in (0.1, 12.0))
    assert deaf["find_time_s"].is_null().sum() >= 3
    assert received["find_time_s"].is_null().sum() <= 1
    first, half = received.filter(pl.col("find_time_s").is_not_null()).select("first_time_s", "find_time_s")
    assert (first < half).all()
    last_m = [mean_distances(runs)[-1] for runs in (deaf, received)]
    assert last_m[0] > 2.0 * last_m[1]

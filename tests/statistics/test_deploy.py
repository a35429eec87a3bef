"""Avoidance, engines and PSO over many runs."""

import json
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from scipy import stats

from swarmwire.comms.observe.interfaces import Observer
from swarmwire.deploy import Result, run
from tests.support.deploy.runs import ROOT
from tests.support.world.scenes import assert_same_on_average

SPEED_MPS, DURATION_S = 0.08, 60.0
SHIPPED = {
    "avoidance": (["duration_s=60"], ("order_velocity", "min_gap")),
    "flocking": (["duration_s=60"], ("order", "min_gap")),
    "five-percent": (["duration_s=60"], ("order", "largest_component")),
    "infrared": ([], ("order", "throughput")),
    "pso": (["duration_s=120"], ("target_mean", "target_best", "age_of_information")),
    "warehouse-wifi": (["duration_s=30"], ("order_velocity", "min_gap", "throughput")),
}
PSO = ROOT / "scenarios" / "pso.toml"
NEAR_M, SHARE = 0.5, 0.5  # success: this share of the robots is this near to the light, at once
DEAF = "radio.loss=1.0"
POSITIONED = [
    "robots.particles.body=epuck-gps",
    "robots.particles.agent=swarmwire.agent.behaviours:PsoSearchPositioned",
]


class Travel(Observer):
    """Observer of how far each robot went, half by half of the run, in m."""

    def begin(self, static):
        self.gone_m = np.zeros((2, static.robots))

    def see(self, truth):
        half = int(truth.time_ns >= DURATION_S / 2 * 1e9)
        self.gone_m[half] += np.hypot(truth.velocity[:, 0], truth.velocity[:, 1]) / 10


@pytest.mark.parametrize("seed", [1, 2])
def test_avoidance_of_twenty_epucks_has_few_collisions(seed):
    travel = Travel()
    metrics = run(
        ROOT / "scenarios" / "avoidance.toml", seed=seed, overrides=[f"duration_s={DURATION_S}"], observers=[travel]
    ).metrics
    assert metrics["collisions"].final is not None
    assert metrics["wall_contacts"].final is not None
    assert metrics["collisions"].final <= 3
    assert metrics["wall_contacts"].final <= 3
    share = travel.gone_m / (SPEED_MPS * DURATION_S / 2)  # of the way without an obstacle
    assert share.mean(axis=1).min() > 0.6
    assert share.min() > 0.2


def means(name: str, engine: str, seeds: int, overrides: list[str]) -> Result:
    path = ROOT / "scenarios" / f"{name}.toml"
    return run(path, seeds=range(1, seeds + 1), overrides=[*overrides, f"physics.engine={engine}"])


def compare(name: str, seeds: int) -> None:
    """The means of these metrics over a run."""
    overrides, metrics = SHIPPED[name]
    discs, pymunk = (means(name, engine, seeds, overrides) for engine in ("discs", "pymunk"))
    assert (discs.engine, pymunk.engine) == ("discs", "pymunk")
    for metric in metrics:
        ours, theirs = (np.array([arena.metrics[metric].mean for arena in result.arenas]) for result in (discs, pymunk))
        assert_same_on_average(f"{name}, {metric}", ours, theirs)


def test_engines_agree_on_avoidance_over_a_few_seeds() -> None:
    compare("avoidance", 12)


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("name", list(SHIPPED))
def test_engines_agree_on_shipped_scenarios(name: str) -> None:
    compare(name, 30)


@pytest.mark.parametrize(("physics", "engine"), [([], "discs"), (["physics.engine=kinematic"], "kinematic")])
def test_summary_names_the_engine(physics: list[str], engine: str, tmp_path: Path) -> None:
    out = tmp_path / "run"
    result = run(ROOT / "scenarios" / "avoidance.toml", overrides=["duration_s=1", *physics], out=out)
    summary: dict[str, Any] = json.loads((out / "summary.json").read_text())
    assert result.engine == summary["engine"] == engine


class Gathering(Observer):
    """Observer of the time in s at which each arena's robots first are near the light; inf if they never are."""

    def begin(self, static):
        self.light_m = np.array([(light.x_m, light.y_m) for (light,) in static.lights])[:, None]
        self.first_s = np.full(static.arenas, np.inf)

    def see(self, truth):
        away_m = truth.pose[:, :2].reshape(len(self.light_m), -1, 2) - self.light_m
        near = np.mean(np.hypot(away_m[..., 0], away_m[..., 1]) <= NEAR_M, axis=1)
        self.first_s[(near >= SHARE) & np.isinf(self.first_s)] = truth.time_ns / 1e9


def successes(seeds: range, *overrides: str, scenario: Path = PSO) -> int:
    """How many of the seeds' arenas succeed before the run's end."""
    gathering = Gathering()
    run(scenario, seeds=seeds, overrides=overrides, observers=[gathering])
    times = np.sort(gathering.first_s)
    count = int(np.isfinite(times).sum())
    quartiles = times[[len(times) * q // 4 for q in (1, 2, 3)]]
    print(f"{overrides}: {count} of {len(seeds)}, quartiles {quartiles} s")
    return count


@pytest.mark.parametrize(
    ("overrides", "least", "most"), [([], 2, 3), (POSITIONED, 2, 3), ([DEAF], 0, 1)], ids=["vectors", "places", "deaf"]
)
def test_pso_finds_the_light_only_with_the_radio(overrides: list[str], least: int, most: int):
    assert least <= successes(range(1, 4), "duration_s=120", *overrides) <= most


@pytest.mark.parametrize(
    "name", ["pso_search", "pso_search_positioned", "pso_model", "pso_ring", "pso_noise_resistant"]
)
def test_pso_variants_find_the_light_only_with_the_radio(name: str):
    scenario = ROOT / "scenarios" / "behaviours" / f"{name}.toml"
    received, deaf = (successes(range(1, 4), *loss, scenario=scenario) for loss in ([], [DEAF]))
    assert received >= 2
    assert deaf == 0


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_pso_finds_the_light_in_nine_of_ten_runs_only_with_the_radio():
    """Fisher's exact test on 50 seeds each: the shares differ at p < 0.01."""
    seeds = range(1, 51)
    received, deaf = successes(seeds), successes(seeds, DEAF)
    assert received >= 0.9 * len(seeds)
    table = [[received, len(seeds) - received], [deaf, len(seeds) - deaf]]
    p = float(cast(Any, stats.fisher_exact)(table, alternative="greater").pvalue)
    print(f"p = {p:.1e}")
    assert p < 0.01

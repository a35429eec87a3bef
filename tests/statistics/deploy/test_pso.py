"""The shipped particle swarm finds the light by what its robots tell one another, and not without."""

from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from scipy import stats

from swarmwire.comms.interfaces import Observer
from swarmwire.deploy import run
from tests.support.deploy.commands import ROOT

PSO = ROOT / "scenarios" / "pso.toml"
NEAR_M, SHARE = 0.5, 0.5  # success: this share of the robots is this near to the light, at once
DEAF = "radio.loss=1.0"
POSITIONED = [
    "robots.particles.body=epuck-gps",
    "robots.particles.agent=swarmwire.agent.behaviours:PsoSearchPositioned",
]


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
def test_a_few_swarms_find_the_light_with_the_radio_alone(overrides: list[str], least: int, most: int):
    assert least <= successes(range(1, 4), "duration_s=120", *overrides) <= most


@pytest.mark.parametrize(
    "name", ["pso_search", "pso_search_positioned", "pso_model", "pso_ring", "pso_noise_resistant"]
)
def test_each_kind_of_particle_swarm_finds_the_light_by_what_is_told(name: str):
    scenario = ROOT / "scenarios" / "behaviours" / f"{name}.toml"
    received, deaf = (successes(range(1, 4), *loss, scenario=scenario) for loss in ([], [DEAF]))
    assert received >= 2
    assert deaf == 0


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_nine_of_ten_swarms_find_the_light_and_fewer_with_the_radio_cut():
    """Fisher's exact test on 50 seeds each: the shares differ at p < 0.01."""
    seeds = range(1, 51)
    received, deaf = successes(seeds), successes(seeds, DEAF)
    assert received >= 0.9 * len(seeds)
    table = [[received, len(seeds) - received], [deaf, len(seeds) - deaf]]
    p = float(cast(Any, stats.fisher_exact)(table, alternative="greater").pvalue)
    print(f"p = {p:.1e}")
    assert p < 0.01

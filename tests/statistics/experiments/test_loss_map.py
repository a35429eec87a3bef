"""The loss map in small: latency and loss break avoidance and flocking, and without losses bursts change nothing."""

from collections.abc import Mapping

import numpy as np
import polars as pl
import pytest

from docs.experiments.experiment import find_experiment
from docs.experiments.figures.loss_map import BEHAVIOURS, CHECKS, results, shares
from docs.experiments.places import HERE
from swarmwire.deploy.scenario_parts import measuring
from swarmwire.world.scenario_file import load_scenario
from tests.support.experiments.miniature import miniature
from tests.support.metrics.swarm.swarms import said, stand

CORNERS = {
    "radio.loss": [0.0, 0.9],
    "radio.bursts.mean_loss": [0.0, 0.9],
    "radio.latency_s": [0.0, 2.0],
    "robots.traffic.params.latency_s": [0.0, 2.0],
}
DURATION_S = {"avoidance": 40, "flocking": 26, "pso": 1}  # a search takes longer than a test may


@pytest.fixture(scope="module")
def corners(tmp_path_factory) -> Mapping[str, pl.DataFrame]:
    """The digests of all campaigns, 4 seeds at the corners of the maps."""
    found: dict[str, pl.DataFrame] = {}
    for behaviour, duration_s in DURATION_S.items():
        names = [name for name in find_experiment("loss-map", HERE).campaigns if f"-{behaviour}" in name]
        folder = tmp_path_factory.mktemp(behaviour)
        over = [f"duration_s={duration_s}"]
        found |= miniature("loss-map", folder, seeds=4, vary=CORNERS, overrides=over, campaigns=names).runs
    return found


@pytest.mark.parametrize("radio", ["", "-bursts"])
@pytest.mark.parametrize("behaviour", ["avoidance", "flocking"])
def test_a_perfect_radio_is_enough_and_a_late_one_that_loses_most_is_not(corners, behaviour, radio):
    _, _, share = shares(results(corners[f"loss-map-{behaviour}{radio}"], behaviour))
    assert share[0, 0] >= 0.75
    assert share[1, 1] <= 0.25


@pytest.mark.parametrize("behaviour", BEHAVIOURS)
def test_without_losses_both_radios_give_the_same_runs(corners, behaviour):
    found = [results(corners[f"loss-map-{behaviour}{radio}"], behaviour) for radio in ("", "-bursts")]
    one, other = (of.filter(of["loss"] == 0.0) for of in found)
    assert one.equals(other)


def test_both_radios_lose_as_much_in_the_mean(corners):
    for name in ("loss-map-flocking", "loss-map-flocking-bursts"):
        late = results(corners[name], "flocking").filter(loss=0.9, latency_s=0.0)
        assert late["radio.link_pdr"].mean() == pytest.approx(0.1, abs=0.03), name


def test_maps_are_drawn_and_cells_told(corners):
    experiment = find_experiment("loss-map", HERE)
    assert len(experiment.draw(corners).axes) == 7  # with the scale
    told = experiment.told(corners).splitlines()
    assert sum(line.startswith("| flocking | ") for line in told) == 5  # four corners, and the whole map
    assert sum("told 3 s before" in line for line in told) == 2
    assert set(CHECKS) <= set(corners)


@pytest.mark.parametrize(
    ("places", "flock"),
    [
        ([(0, 0, 0), (0.5, 0, 0), (1.0, 0, 0), (1.5, 0, 0)], 1.0),
        ([(0, 0, 0), (0.5, 0, 0), (2.0, 0, 0), (2.5, 0, 0)], 0.5),  # parallel, and apart
        ([(0, 0, 0), (0.5, 0, np.pi), (1.0, 0, 0), (1.5, 0, np.pi)], 0.0),  # together, each its way
    ],
)
def test_a_flock_is_aligned_and_together(places, flock):
    scenario = load_scenario(HERE.campaigns / "scenarios" / "loss-map-flocking.toml")
    (metric,) = measuring(scenario).metrics
    assert said(metric, stand(*places)) == [pytest.approx(flock, abs=1e-9)]

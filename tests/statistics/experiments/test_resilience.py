"""Resilience in small: fewer robots do less, and how much less is fitted and told."""

import numpy as np
import polars as pl
import pytest

from docs.experiments.experiment import find_experiment
from docs.experiments.places import HERE
from tests.support.experiments.miniature import miniature

SHARES = (0.0, 0.2, 0.5)
FEW = {"events": [[{"at_s": 0.0, "do": "kill", "robots": {"share": share}}] if share else [] for share in SHARES]}
SMALL_FLOOR = ["arena.size_m=[7, 7]", 'robots.swarm.place={ how = "box", size_m = [6.6, 6.6] }']
SMALL_SEARCH = ["duration_s=40", "robots.particles.params.update_every_ticks=40", "arena.size_m=[5, 5]"]


def test_the_dead_are_missed_in_coverage_and_search_and_both_are_drawn_and_told(tmp_path):
    runs = {}
    for campaign, small in (("resilience-coverage", SMALL_FLOOR), ("resilience-search", SMALL_SEARCH)):
        of = miniature("resilience", tmp_path, seeds=3, vary=FEW, overrides=small, campaigns=[campaign])
        runs |= of.runs
    experiment = find_experiment("resilience", HERE)
    assert sorted(runs["resilience-coverage"]["disabled"].unique()) == list(SHARES)
    for reading in experiment.module.READINGS[:4]:
        share, table = experiment.module.efficiency(runs, reading)
        assert share.tolist() == list(SHARES)
        assert table[0].mean() == pytest.approx(1.0)
        assert table[-1].mean() < 0.9
    assert len(experiment.draw(runs).axes) == 3
    assert experiment.told(runs).count("\n") == 1 + len(experiment.module.READINGS)


def test_efficiency_is_the_reciprocal_of_time_relative_to_none_disabled_and_unfinished_runs_count_as_their_length():
    digest = pl.DataFrame(
        {
            "seed": [1, 2] * 2,
            "disabled": [0.0, 0.0, 0.5, 0.5],
            "ended": ["stopped"] * 3 + ["duration"],
            "time_s": [10.0, 20.0, 20.0, None],
            "sim_time_s": [10.0, 20.0, 20.0, 100.0],
        }
    )
    module = find_experiment("resilience", HERE).module
    reading = module.Reading("search", "resilience-search", "time_s")
    share, table = module.efficiency({"resilience-search": digest}, reading)
    assert share.tolist() == [0.0, 0.5]
    assert table == pytest.approx(np.array([[0.1, 0.05], [0.05, 0.01]]) / 0.075)

"""Fragmentation in small: flocks fall apart where something stands between them, and are told as whole or censored."""

import numpy as np
import polars as pl
import pytest

from docs.experiments.experiment import find_experiment
from docs.experiments.places import HERE
from tests.support.experiments.miniature import miniature

ROCK, PEBBLE = (
    [{"shape": "polygon", "points": [[0, tip], [half, -0.7], [half, 1], [-half, 1], [-half, -0.7]], "at": [0, 0]}]
    for half, tip in ((0.6, -1.6), (0.01, -0.71))
)
FEW = {
    "arena.obstacles": [PEBBLE, ROCK],
    "events.0.for_s": [20.0],
    "events.0.at_s": [0.5],
    "radio.loss": [0.0],
}


def module():
    return find_experiment("fragmentation", HERE).module


def test_all_campaigns_come_to_a_figure_and_numbers_and_what_is_wide_splits(tmp_path):
    of = miniature("fragmentation", tmp_path, seeds=2, vary=FEW, overrides=["duration_s=28"])
    assert len(of.figure.axes) == 2 * len(of.runs)
    assert of.told.count("Split by") == len(of.runs)
    split = {name: len(module().fell_apart(runs)) for name, runs in of.runs.items()}
    assert split["fragmentation-partition"] == 2, "in every run six do not hear the other six"
    at_rocks = of.runs["fragmentation-obstacle"]
    narrow, wide = (at_rocks.filter(pl.col("width_m") == width_m) for width_m in (0.02, 1.2))
    assert len(module().fell_apart(narrow)) == 0
    assert len(module().fell_apart(wide)) == 2


def runs(**columns):
    """Three runs: whole 7 s after 20 s of partition, whole before its end, and never whole in 100 s."""
    given = {
        "seed": [1, 2, 3],
        "stop_time_s": [37.0, 25.0, None],
        "sim_time_s": [47.0, 35.0, 100.0],
        "fragmentations.final": [1.0, 1.0, 2.0],
        "fragmented.mean": [0.5, 0.2, 0.9],
    }
    return pl.DataFrame(given | columns)


def test_of_what_ends_time_counts_from_its_end_and_is_censored_at_the_runs():
    times = module().times_apart(runs(**{"events.0.at_s": [10.0] * 3, "events.0.for_s": [20.0] * 3}))
    assert times.value == pytest.approx([7.0, 0.0, 70.0])
    assert times.observed.tolist() == [True, True, False]


def test_of_an_obstacle_all_time_in_pieces_counts():
    times = module().times_apart(runs())
    assert times.value == pytest.approx([25.5, 9.0, 94.0])


def test_runs_that_never_fell_apart_take_no_part():
    whole = runs(**{"fragmentations.final": [0.0, 0.0, 1.0]})
    assert np.array_equal(module().times_apart(whole).seed, [3])

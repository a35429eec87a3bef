"""Dense flocks in small: a crowded box stands still, out of order, where a sparse one moves."""

import numpy as np

from docs.experiments.figures.dense import covered, frozen
from tests.support.experiments.miniature import miniature

COUNT, SPACING = "robots.flock.count", "robots.flock.place.spacing_m"


def test_a_crowded_box_freezes_and_loses_its_order(tmp_path) -> None:
    small = (
        miniature(
            "dense",
            tmp_path,
            seeds=2,
            campaigns=["dense-box"],
            overrides=["duration_s=12"],
            vary={COUNT: [49, 100, 169], SPACING: [0.1541, 0.1027, 0.0771]},
        )
        .runs["dense-box"]
        .sort(COUNT)
    )
    speed, order = small["speed"].to_numpy(), small["order"].to_numpy()
    assert speed[:2].min() > 0.03
    assert speed[4:].max() < 0.001
    assert order[4:].max() < order[:2].min()
    jump = frozen(small, "dense-box")
    assert jump is not None
    assert jump.after < jump.place < jump.before == covered(169, "dense-box")


def test_who_goes_round_the_ring_passes_the_gate(tmp_path) -> None:
    small = miniature(
        "dense",
        tmp_path,
        seeds=1,
        campaigns=["dense"],
        overrides=["duration_s=40"],
        vary={COUNT: [80], "physics.steps": [5]},
    ).runs["dense"]
    assert 20.0 < small["flow_per_min"].item() < 300.0
    assert small["rotation"].item() > 0.5


def test_a_pillar_takes_its_floor_away() -> None:
    assert covered(100, "dense") > covered(100, "dense-box") * 0.7
    assert np.isclose(covered(196, "dense-box"), 0.754, atol=1e-3)

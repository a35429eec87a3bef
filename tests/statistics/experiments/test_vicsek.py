"""Vicsek's model in small: order falls with noise, and is that of the noise alone where all hear all."""

import numpy as np
import pytest

from docs.experiments.experiment import find_experiment
from docs.experiments.figures.vicsek import all_to_all
from docs.experiments.places import HERE
from tests.support.experiments.miniature import miniature
from tests.support.experiments.vicsek_reference import mean_direction, mean_order

NOISE = "robots.particles.params.noise_rad"
FEWER = ["duration_s=200", "robots.particles.count=40", "arena.size_m=[3.162278, 3.162278]"]


def test_order_falls_with_noise_and_is_exact_where_all_hear_all(tmp_path) -> None:
    small = miniature("vicsek", tmp_path, seeds=2, vary={NOISE: [1.0, 4.0]}, overrides=FEWER)
    low, high = (small.runs["vicsek"].sort(NOISE)["order.late"].to_numpy()[at] for at in (slice(0, 2), slice(2, 4)))
    assert low.min() > 0.9
    assert high.max() < 0.7
    alike = small.runs["vicsek-all"]
    expected = all_to_all(alike[NOISE].to_numpy(), 40)
    assert alike["order.late"].to_numpy() == pytest.approx(expected, abs=0.03)
    assert len(small.figure.axes) == 2
    assert "| all hear all | 4 |" in small.told


def test_the_correction_for_few_robots_is_that_of_drawn_headings() -> None:
    """100,000 orders of 20 headings: their mean is known to 0.0005 or better."""
    draws = np.random.default_rng(1).uniform(-0.5, 0.5, (100_000, 20)) * 4.0
    order = np.hypot(np.cos(draws).mean(axis=1), np.sin(draws).mean(axis=1)).mean()
    assert order == pytest.approx(all_to_all(4.0, 20), abs=2e-3)
    assert abs(order - all_to_all(4.0)) > 0.02


def test_the_burn_in_is_told_for_each_campaign() -> None:
    experiment = find_experiment("vicsek", HERE)
    assert set(experiment.module.BURN_IN) == set(experiment.campaigns)


@pytest.mark.slow
@pytest.mark.parametrize(("share", "old", "new"), [(0.28, 0.68, 0.53), (0.32, 0.58, 0.38)])
def test_whether_the_old_or_the_new_direction_moves_accounts_for_what_the_page_says(share, old, new) -> None:
    """512 particles at 0.1 a step: by the old one as measured here, by the new one as the other program has it.

    Of three runs each: single ones are up to 0.1 apart.
    """
    noise_rad = 2.0 * np.pi * share
    order = {
        which: np.mean(
            [mean_order(512, 512**0.5, 0.1, noise_rad, (2_000, 8_000), new=which, seed=k) for k in (1, 2, 3)]
        )
        for which in (False, True)
    }
    assert order[False] == pytest.approx(old, abs=0.09)
    assert order[True] == pytest.approx(new, abs=0.09)
    assert order[False] > order[True] + 0.05


def test_the_reference_takes_the_mean_direction_of_all_within_one() -> None:
    draws = np.random.default_rng(2)
    x, y, theta = (draws.uniform(0.0, 5.3, 60) for _ in range(3))
    apart = [along[:, None] - along[None, :] for along in (x, y)]
    near = np.hypot(*(of - 5.3 * np.round(of / 5.3) for of in apart)) <= 1.0
    expected = np.arctan2(near @ np.sin(theta), near @ np.cos(theta))
    assert mean_direction(x, y, theta, 5.3) == pytest.approx(expected)

"""Spells and turns of a random walk, and the ground that walkers cover."""

from pathlib import Path

import numpy as np
import pytest

from swarmwire.agent.behaviours import RandomWalk
from swarmwire.agent.testing import Trial, assert_rows_independent
from swarmwire.deploy import run
from tests.support.agent.behaviours.walker import Walker

SCENARIO = Path("scenarios/behaviours/random_walk.toml")
MANY = 4000


def test_rows_do_not_depend_on_one_another():
    assert_rows_independent(RandomWalk, Trial())


@pytest.mark.parametrize("persistence", [0.0, 0.3, 0.8])
def test_persistence_is_the_mean_cosine_of_the_turns(persistence):
    turned = Walker(RandomWalk, n=MANY, persistence=persistence).first_turns_rad()
    assert np.mean(np.cos(turned)) == pytest.approx(persistence, abs=4.0 / MANY**0.5)
    assert np.mean(np.sin(turned)) == pytest.approx(0.0, abs=4.0 / MANY**0.5)


def test_who_persists_wholly_never_turns():
    walker = Walker(RandomWalk, n=20, persistence=1.0, spell_m=0.1)
    for _ in range(50):
        assert np.abs(walker.step().angular_radps).max() < 1e-12


def test_spells_are_exponential_or_all_the_same():
    random, fixed = (Walker(RandomWalk, n=MANY, spell_m=0.5, exponential=on) for on in (True, False))
    random.step()
    fixed.step()
    lengths = random.memory.left_m
    assert lengths.mean() == pytest.approx(0.5, rel=0.06)
    assert np.median(lengths) == pytest.approx(0.5 * np.log(2.0), rel=0.08)
    assert np.ptp(fixed.memory.left_m) <= 0.01 + 1e-12, "but for who has driven a step"


def test_a_spell_of_so_many_metres_takes_so_long():
    walker = Walker(RandomWalk, spell_m=0.5, exponential=False, persistence=1.0)
    left = [walker.step() and float(walker.memory.left_m[0]) for _ in range(49)]
    assert left[0] == pytest.approx(0.49)
    assert left[-1] == pytest.approx(0.01)


@pytest.mark.parametrize("near_rad", [0.0, 0.9, -0.9])
def test_the_next_heading_is_on_the_half_circle_away_from_what_is_near_ahead(near_rad):
    turned = Walker(RandomWalk, n=500, persistence=1.0).first_turns_rad(near_rad=near_rad)
    away = np.cos(turned - near_rad)
    assert away.max() < 0.35, "rays stand up to 40 degrees apart, so that their sum does not show quite where"
    assert away.min() < -0.95


def test_what_is_behind_is_in_nobodys_way():
    walker = Walker(RandomWalk, n=20, persistence=1.0)
    assert (walker.step(near_rad=np.pi).linear_mps == 0.1).all()


def test_walkers_without_walls_cover_what_koopmans_law_says(tmp_path):
    """Alone on a torus, in spells of a side: 1 - exp(-N (pi R^2 + 2 R v t) / A), see `coverage`."""
    on_a_torus = [
        'arena={ size_m = [8.0, 8.0], boundary = "torus" }',
        'physics={ engine = "kinematic" }',
        'robots.walkers.place={ how = "box", size_m = [8.0, 8.0] }',
        "robots.walkers.params={ spell_m = 8.0, turn_radps = 4.8 }",
        "standard_metrics=false",
    ]
    result = run(SCENARIO, seeds=range(1, 41), overrides=on_a_torus)
    covered = np.array([arena.metrics["coverage"].final for arena in result.arenas])
    law = 1.0 - np.exp(-10 * (np.pi * 0.25 + 2.0 * 0.5 * 0.1 * 60.0) / 64.0)
    assert covered.mean() == pytest.approx(law, abs=0.025)


def test_who_tumbles_all_the_time_covers_less():
    few = ["standard_metrics=false", "duration_s=40"]
    far, tumbling = (
        run(SCENARIO, seeds=range(1, 9), overrides=[*few, f"robots.walkers.params={{ spell_m = {spell_m} }}"])
        for spell_m in (2.0, 0.05)
    )
    least = min(arena.metrics["coverage"].final for arena in far.arenas)
    assert least > max(arena.metrics["coverage"].final for arena in tumbling.arenas)

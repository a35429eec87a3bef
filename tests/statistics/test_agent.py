"""What whole swarms do by the behaviours that come along: full-length runs, with and without what they rest on."""

from pathlib import Path

import numpy as np
import pytest

from swarmwire.deploy import Simulation, run

SCENARIOS = Path(__file__).parents[2] / "scenarios"
SHOWN = SCENARIOS / "behaviours"
FIVE = """
format = 1
name = "five"
duration_s = 60.0
standard_metrics = false
metrics = [{ metric = "aggregation", gap_m = 0.21 }] # three diameters

[time]
rate_hz = 20

[arena]
size_m = [1.4, 1.4]

[robots.swarm]
body = "flockbot"
count = 5
agent = "swarmwire.agent.behaviours:MinimalistFlocking"
"""


def test_aggregation_needs_the_radio():
    few = ["standard_metrics=false", "duration_s=60", "metrics.0.metric=aggregation"]
    hearing, deaf = (
        np.array(
            [
                arena.metrics["aggregation"].final
                for arena in run(SHOWN / "aggregation.toml", seeds=range(1, 6), overrides=o).arenas
            ]
        )
        for o in (few, [*few, "radio.loss=1.0"])
    )
    assert hearing.min() > deaf.max()
    assert hearing.mean() > 0.35


def covered(*overrides: str) -> np.ndarray:
    result = run(
        SHOWN / "coverage.toml", seeds=range(1, 9), overrides=["standard_metrics=false", "duration_s=40", *overrides]
    )
    return np.array([arena.metrics["coverage"].final for arena in result.arenas])


def test_coverage_is_larger_with_the_radio():
    hearing, deaf = covered(), covered("radio.loss=1.0")
    assert np.count_nonzero(hearing > deaf) >= 7
    assert hearing.mean() > 1.1 * deaf.mean()


def test_random_walk_coverage_on_a_torus_matches_koopmans_law():
    """Alone on a torus, in spells of a side: 1 - exp(-N (pi R^2 + 2 R v t) / A), see `coverage`."""
    on_a_torus = [
        'arena={ size_m = [8.0, 8.0], boundary = "torus" }',
        'physics={ engine = "kinematic" }',
        'robots.walkers.place={ how = "box", size_m = [8.0, 8.0] }',
        "robots.walkers.params={ spell_m = 8.0, turn_radps = 4.8 }",
        "standard_metrics=false",
    ]
    result = run(SHOWN / "random_walk.toml", seeds=range(1, 41), overrides=on_a_torus)
    covered = np.array([arena.metrics["coverage"].final for arena in result.arenas])
    law = 1.0 - np.exp(-10 * (np.pi * 0.25 + 2.0 * 0.5 * 0.1 * 60.0) / 64.0)
    assert covered.mean() == pytest.approx(law, abs=0.025)


def test_random_walk_with_short_spells_covers_less():
    few = ["standard_metrics=false", "duration_s=40"]
    far, tumbling = (
        run(
            SHOWN / "random_walk.toml",
            seeds=range(1, 9),
            overrides=[*few, f"robots.walkers.params={{ spell_m = {spell_m} }}"],
        )
        for spell_m in (2.0, 0.05)
    )
    least = min(arena.metrics["coverage"].final for arena in far.arenas)
    assert least > max(arena.metrics["coverage"].final for arena in tumbling.arenas)


def test_beacon_avoidance_has_collisions_only_without_the_radio() -> None:
    seeds, short = [1, 2, 3, 4], ["duration_s=30"]
    received = run(SHOWN / "beacon_avoidance.toml", seeds=seeds, overrides=short)
    unheard = run(SHOWN / "beacon_avoidance.toml", seeds=seeds, overrides=[*short, "radio.loss=1.0"])
    assert [arena.metrics["collisions"].final for arena in received.arenas] == [0.0] * 4
    assert 0.0 not in [arena.metrics["collisions"].final for arena in unheard.arenas]


def together(path: Path, *overrides: str) -> float:
    """The mean share of the swarm in its largest cluster, over 20 arenas and a minute."""
    path.write_text(FIVE)
    simulation = Simulation(path, seeds=range(1, 21), overrides=[f"robots.swarm.params.{value}" for value in overrides])
    with simulation:
        simulation.run()
    return float(np.mean([arena.metrics["aggregation"].mean for arena in simulation.result.arenas]))


def test_minimalist_flocking_gathers_by_cohesion(tmp_path):
    path = tmp_path / "five.toml"
    without = together(path, "lateral_diameters=9.0", "rear_diameters=9.0")
    assert together(path) > without + 0.05

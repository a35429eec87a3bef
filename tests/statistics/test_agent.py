"""What whole swarms do by the behaviours that come along: full-length runs, with and without what they rest on."""

from pathlib import Path

import numpy as np
import pytest

from swarmwire.deploy import Simulation, run

SCENARIOS = Path(__file__).parents[2] / "scenarios"
SHOWN, PAPERS = SCENARIOS / "behaviours", SCENARIOS / "papers" / "scenarios"
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


def spread_m(*overrides: str) -> float:
    """The distance from a foot-bot to its nearest neighbour after 30 s, mean over robots and 3 arenas."""
    options = ["metrics=['nearest_neighbour']", "duration_s=30", "robots.flock.place.radius_m=0.8", *overrides]
    simulation = Simulation(SHOWN / "lennard_jones_flocking.toml", seeds=range(1, 4), overrides=options)
    with simulation:
        simulation.run()
    return float(np.mean([arena.metrics["nearest_neighbour"].final for arena in simulation.result.arenas]))


def test_lennard_jones_flock_spreads_only_with_the_radio():
    assert 0.55 < spread_m("robots.flock.params={light=0.0}") < 0.85
    assert spread_m("robots.flock.params={light=0.0}", "radio.loss=1.0") < 0.45


def test_threshold_rule_deadlocks_in_a_corridor_unless_smoothed() -> None:
    stuck = {
        kind: [
            arena.metrics["deadlocked"].final
            for arena in run(PAPERS / "corridor.toml", seeds=[1, 2], overrides=overrides).arenas
        ]
        for kind in ("ThresholdRule", "SmoothedAvoidance")
        for overrides in [["duration_s=60", f"robots.crowd.agent='swarmwire.agent.behaviours:{kind}'"]]
    }
    assert all(share is not None and share >= 0.5 for share in stuck["ThresholdRule"])
    assert stuck["SmoothedAvoidance"] == [0.0, 0.0]


def order(noise_rad: float, range_m: float, ticks: int = 400, count: int = 100) -> float:
    """The mean order over the second half of a run."""
    options = {"duration_s": ticks, "robots.particles.params.noise_rad": noise_rad, "radio.range_m": range_m}
    options["robots.particles.count"] = count
    values: list[float] = []
    with Simulation(
        PAPERS / "vicsek.toml", overrides=[f"{key}={value}" for key, value in options.items()]
    ) as simulation:
        for _ in range(ticks):
            simulation.step()
            heading = simulation.world.pose[:, 2]
            values.append(float(np.hypot(np.cos(heading).mean(), np.sin(heading).mean())))
    return float(np.mean(values[ticks // 2 :]))


@pytest.mark.parametrize("noise_rad", [1.0, 4.0])
def test_vicsek_order_under_all_to_all_radio_matches_the_noise(noise_rad: float) -> None:
    """Each is off the common direction by its own noise: 200 independent ticks, so 5 standard errors allow for luck."""
    mean = np.sin(noise_rad / 2.0) / (noise_rad / 2.0)
    across = 0.5 * (1.0 - np.sin(noise_rad) / noise_rad)  # variance of the sine of the noise
    along = 0.5 * (1.0 + np.sin(noise_rad) / noise_rad) - mean**2
    expected = mean + across / (2.0 * 100 * mean)
    assert order(noise_rad, 4.0) == pytest.approx(expected, abs=5.0 * np.sqrt(along / 100 / 200) + 1e-3)


def test_vicsek_order_without_neighbours_is_low() -> None:
    assert order(1.0, 0.001, 600) < 0.2
    assert order(1.0, 1.0, 600) > 0.9


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

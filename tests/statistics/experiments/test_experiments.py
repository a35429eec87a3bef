from collections.abc import Mapping
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from docs.experiments.experiment import LAYOUT, find_experiment
from docs.experiments.figures._consensus_model import graph_of
from docs.experiments.figures._pso import mean_distances
from docs.experiments.figures.dense import covered, frozen
from docs.experiments.figures.loss_map import BEHAVIOURS, CHECKS, results, shares
from docs.experiments.figures.movement import BLIND, FAINT, points
from docs.experiments.figures.threshold import BOUNDARY, PARTS, RULE, SMOOTHED, sample_of
from docs.experiments.figures.threshold import COUNT as THRESHOLD_COUNT
from docs.experiments.figures.vicsek import all_to_all
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.deploy.runs.scenario_parts import selected_metrics
from swarmwire.world.scenario_file import load_scenario
from tests.support.experiments import mean_direction, mean_order, miniature
from tests.support.metrics.swarms import measure, stand

SCENARIOS: Path = LAYOUT.campaigns / "scenarios"
COUNT, SPACING = "robots.flock.count", "robots.flock.place.spacing_m"
ROCK, PEBBLE = (
    [{"shape": "polygon", "points": [[0, tip], [half, -0.7], [half, 1], [-half, 1], [-half, -0.7]], "at": [0, 0]}]
    for half, tip in ((0.6, -1.6), (0.01, -0.71))
)
FEW = {"arena.obstacles": [PEBBLE, ROCK], "events.0.for_s": [20.0], "events.0.at_s": [0.5], "radio.loss": [0.0]}
NAME = "minimalist-flocking"
SMALL = [
    "duration_s=60",
    "arena.size_m=[4, 4]",
    "arena.lights.0.intensity=2.3",
    "robots.particles.params.update_every_ticks=40",
]
FEW_POINTS = {"radio.loss": [0.0, 0.8], "radio.latency_s": [0.0, 5.0], "robots.particles.params.inertia": [0.6, 0.8]}
SHARES = (0.0, 0.2, 0.5)
FEW_RESILIENCE = {
    "events": [[{"at_s": 0.0, "do": "kill", "robots": {"share": share}}] if share else [] for share in SHARES]
}
SMALL_FLOOR = ["arena.size_m=[7, 7]", 'robots.swarm.place={ how = "box", size_m = [6.6, 6.6] }']
SMALL_SEARCH = ["duration_s=40", "robots.particles.params.update_every_ticks=40", "arena.size_m=[5, 5]"]
PARTS_HERE = [{"blocked_rad": 4.0, "smooth_s": 0.0}, {"blocked_rad": 1.5708, "smooth_s": 0.3}]
NOISE = "robots.particles.params.noise_rad"
FEWER = ["duration_s=200", "robots.particles.count=40", "arena.size_m=[3.162278, 3.162278]"]
CORNERS = {
    "radio.loss": [0.0, 0.9],
    "radio.bursts.mean_loss": [0.0, 0.9],
    "radio.latency_s": [0.0, 2.0],
    "robots.traffic.params.latency_s": [0.0, 2.0],
}
DURATION_S = {"avoidance": 40, "flocking": 26, "pso": 1}  # a search takes longer than a test may


def test_consensus_decays_by_the_formula_and_losses_bias_it(tmp_path) -> None:
    """Three standard errors of 60 seeds: of six points one is beyond by luck in 2 % of all sets of seeds."""
    small = miniature("consensus", tmp_path, seeds=60, vary={"radio.loss": [0.0, 0.5]}, overrides=["duration_s=17"])
    for campaign, name, range_m in (("consensus", "consensus", 0.8), ("consensus-random", "consensus-random", None)):
        runs, graph = small.runs[campaign], graph_of(SCENARIOS / f"{name}.toml", range_m)
        for loss in (0.0, 0.5):
            at = runs.filter(runs["radio.loss"] == loss)
            if range_m is not None:
                at = at.filter(at["radio.range_m"] == range_m)
            remaining, steps = at["first_pattern"].to_numpy(), int(at["steps"][0])
            error = 3.0 * remaining.std() / np.sqrt(len(remaining)) + 1e-6
            assert remaining.mean() == pytest.approx(graph.decay(loss) ** steps, abs=error)
            assert np.sqrt((at["consensus_bias"].to_numpy() ** 2).mean()) == pytest.approx(
                graph.after(steps, loss).bias, rel=0.3, abs=1e-6
            )
    assert len(small.figure.axes) == 2
    assert "| ring of 10 | 0.5 |" in small.numbers


def drawn(graph, loss: float, steps: int, seed: int) -> FloatArray:
    """Values after so many steps with losses drawn here, (n,)."""
    draws, x = np.random.default_rng(seed), graph.start.copy()
    for _ in range(steps):
        received = graph.adjacency * (draws.random(graph.adjacency.shape) >= loss)
        x = x + graph.gain * (received @ x - received.sum(axis=1) * x)
    return x


def test_consensus_moments_match_drawn_losses() -> None:
    graph = graph_of(SCENARIOS / "consensus.toml", 3.0)
    values = np.array([drawn(graph, 0.6, 5, seed) for seed in range(4000)])
    exact = graph.after(5, 0.6)
    assert np.sqrt((values.mean(axis=1) ** 2).mean()) == pytest.approx(exact.bias, rel=0.05)
    assert np.sqrt(values.var(axis=1).mean()) == pytest.approx(exact.error, rel=0.01)
    assert values.mean(axis=0) == pytest.approx(graph.start * exact.pattern, abs=0.01)


def test_consensus_graphs_match_their_scenarios() -> None:
    ring, everyone, random = (
        graph_of(SCENARIOS / "consensus.toml", 0.8),
        graph_of(SCENARIOS / "consensus.toml", 3.0),
        graph_of(SCENARIOS / "consensus-random.toml"),
    )
    assert ring.slowest == pytest.approx(2.0 - 2.0 * np.cos(0.2 * np.pi))
    assert everyone.slowest == pytest.approx(10.0)
    assert random.slowest == pytest.approx(0.8784, abs=1e-4)
    for graph in (ring, everyone, random):
        assert graph.laplacian @ graph.start == pytest.approx(graph.slowest * graph.start, abs=1e-6)


def test_dense_box_freezes_and_loses_its_order(tmp_path) -> None:
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
    assert jump.after < jump.position < jump.before == covered(169, "dense-box")


def test_dense_ring_passes_the_gate(tmp_path) -> None:
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


def test_dense_pillar_is_subtracted_from_the_area() -> None:
    assert covered(100, "dense") > covered(100, "dense-box") * 0.7
    assert np.isclose(covered(196, "dense-box"), 0.754, atol=1e-3)


def module():
    return find_experiment("fragmentation", LAYOUT).module


def test_fragmentation_is_drawn_and_wide_gaps_split(tmp_path):
    small = miniature("fragmentation", tmp_path, seeds=2, vary=FEW, overrides=["duration_s=28"])
    assert len(small.figure.axes) == 2 * len(small.runs)
    assert small.numbers.count("Split by") == len(small.runs)
    split = {name: len(module().fell_apart(runs)) for name, runs in small.runs.items()}
    assert split["fragmentation-partition"] == 2, "in every run six do not hear the other six"
    at_rocks = small.runs["fragmentation-obstacle"]
    narrow, wide = (at_rocks.filter(pl.col("width_m") == width_m) for width_m in (0.02, 1.2))
    assert len(module().fell_apart(narrow)) == 0
    assert len(module().fell_apart(wide)) == 2


def runs(**columns):
    """Three runs: whole 7 s after 20 s of partition, whole before its end, and never whole in 100 s."""
    defaults = {
        "seed": [1, 2, 3],
        "stop_time_s": [37.0, 25.0, None],
        "sim_time_s": [47.0, 35.0, 100.0],
        "fragmentations.final": [1.0, 1.0, 2.0],
        "fragmented.mean": [0.5, 0.2, 0.9],
    }
    return pl.DataFrame(defaults | columns)


def test_fragmentation_time_counts_from_the_end_of_an_event():
    times = module().times_apart(runs(**{"events.0.at_s": [10.0] * 3, "events.0.for_s": [20.0] * 3}))
    assert times.value == pytest.approx([7.0, 0.0, 70.0])
    assert times.observed.tolist() == [True, True, False]


def test_fragmentation_time_at_an_obstacle_is_all_time_in_pieces():
    times = module().times_apart(runs())
    assert times.value == pytest.approx([25.5, 9.0, 94.0])


def test_fragmentation_excludes_runs_that_never_split():
    unsplit = runs(**{"fragmentations.final": [0.0, 0.0, 1.0]})
    assert np.array_equal(module().times_apart(unsplit).seed, [3])


def test_learning_is_drawn_with_policies_and_rules_of_both_tasks(tmp_path: Path) -> None:
    small = miniature("learning", tmp_path, seeds=2, vary={"radio.loss": [0.0, 0.9]}, overrides=["duration_s=5"])
    assert len(small.figure.axes) == 2
    for axes in small.figure.axes:
        assert [len(line.get_xdata()) for line in axes.lines] == [2, 2, 2]
    assert small.numbers.count("| 0.9 | ") == 2


def test_lennard_jones_is_drawn_and_oscillates_more_under_loss(tmp_path):
    vary = {"radio.loss": [0.0, 0.9], "radio.latency_s": [0.0, 0.5]}
    small = miniature("lennard-jones", tmp_path, seeds=3, vary=vary, overrides=["duration_s=20"])
    (runs,) = small.runs.values()
    assert len(small.figure.axes) == 4
    assert small.numbers.count("\n") == 1 + 4
    mean = {key: g["oscillation.final"].to_numpy().mean() for key, g in runs.group_by("radio.loss", "radio.latency_s")}
    assert mean[0.9, 0.0] > 1.5 * mean[0.0, 0.0]


def test_minimalist_flocking_is_drawn_with_all_rows(tmp_path):
    small = miniature(NAME, tmp_path, seeds=2, overrides=["duration_s=1"])
    assert len(small.figure.axes) == 4
    assert small.numbers.count("**") == 2 * 6
    assert all(f"| equal density | {n} | 2 |" in small.numbers for n in (5, 10, 15, 20))


def test_minimalist_flocking_depends_on_thresholds_and_hop_comes_last(tmp_path):
    (runs,) = miniature(
        NAME, tmp_path, seeds=10, overrides=["duration_s=25"], campaigns=["minimalist-thresholds"]
    ).runs.values()
    by_hop, by_cluster = (runs[name].fill_null(np.inf) for name in ("hop_60_s", "cluster_60_s"))
    assert (by_cluster <= by_hop).all()
    assert (runs["hop_60_s"].fill_null(np.inf) <= runs["hop_80_s"].fill_null(np.inf)).all()
    met = runs.group_by("robots.swarm.params.separation_diameters").agg(pl.col("hop_60_s").is_not_null().mean())
    share = dict(met.iter_rows())
    assert share[0.5] > share[1.0] + 0.2


def test_minimalist_flocking_times_are_censored_at_the_limit(tmp_path):
    (runs,) = miniature(
        NAME, tmp_path, seeds=3, overrides=["duration_s=2"], campaigns=["minimalist-small"]
    ).runs.values()
    waiting = runs.filter(pl.col("hop_80_s").is_null())
    assert len(waiting)
    assert waiting["sim_time_s"].to_list() == pytest.approx([2.0] * len(waiting))


def test_movement_with_proximity_covers_more_and_touches_less(tmp_path: Path) -> None:
    small = {"arena.size_m": [[3.0, 3.0], [4.0, 4.0]], "arena.obstacles.0.radius_m": [0.05, 0.2]}
    done = miniature("movement", tmp_path, seeds=2, vary=small, overrides=["duration_s=60"])
    runs = done.runs["movement"]
    looks = runs.filter(pl.col(FAINT) < BLIND)
    blind = runs.filter(pl.col(FAINT) >= BLIND)
    assert looks["wall_contacts.final"].sum() * 10 < blind["wall_contacts.final"].sum()
    assert looks["collision_rate.final"].sum() < blind["collision_rate.final"].sum()
    assert (looks["coverage.final"].to_numpy() > blind["coverage.final"].to_numpy()).all()
    assert {(side, radius) for side, radius, _, _ in points(runs)} == {(s, r) for s in (3.0, 4.0) for r in (0.05, 0.2)}
    assert len(done.figure.axes) == 3
    assert done.numbers.count("\n| ") == 2 + 8


@pytest.mark.slow
@pytest.mark.parametrize(("name", "panels", "tables"), [("pso", 6, 8), ("pso-why", 1, 2)])
def test_pso_is_drawn_with_all_campaigns(tmp_path, name, panels, tables):
    short = [*SMALL, "duration_s=20"]
    small = miniature(name, tmp_path, seeds=1, vary={**FEW_POINTS, "radio.range_m": [2.0, 12.0]}, overrides=short)
    assert len(small.figure.axes) == panels
    assert small.numbers.count("\n\n| ") == tables


@pytest.mark.parametrize("campaign", ["pso-range", "pso-range-model"])
def test_pso_with_radio_finds_the_light_and_comes_nearer(tmp_path, campaign):
    small = miniature(
        "pso", tmp_path, seeds=4, vary={"radio.range_m": [0.1, 12.0]}, overrides=SMALL, campaigns=[campaign]
    )
    deaf, received = (small.runs[campaign].filter(pl.col("radio.range_m") == range_m) for range_m in (0.1, 12.0))
    assert deaf["find_time_s"].is_null().sum() >= 3
    assert received["find_time_s"].is_null().sum() <= 1
    first, half = received.filter(pl.col("find_time_s").is_not_null()).select("first_time_s", "find_time_s")
    assert (first < half).all()
    last_m = [mean_distances(runs)[-1] for runs in (deaf, received)]
    assert last_m[0] > 2.0 * last_m[1]


def test_resilience_falls_with_dead_robots_and_is_drawn(tmp_path):
    runs = {}
    for campaign, small in (("resilience-coverage", SMALL_FLOOR), ("resilience-search", SMALL_SEARCH)):
        done = miniature("resilience", tmp_path, seeds=3, vary=FEW_RESILIENCE, overrides=small, campaigns=[campaign])
        runs |= done.runs
    experiment = find_experiment("resilience", LAYOUT)
    assert sorted(runs["resilience-coverage"]["disabled"].unique()) == list(SHARES)
    for reading in experiment.module.READINGS[:4]:
        share, table = experiment.module.efficiency(runs, reading)
        assert share.tolist() == list(SHARES)
        assert table[0].mean() == pytest.approx(1.0)
        assert table[-1].mean() < 0.9
    assert len(experiment.draw(runs).axes) == 3
    assert experiment.numbers(runs).count("\n") == 1 + len(experiment.module.READINGS)


def test_resilience_efficiency_counts_unfinished_runs_at_their_length():
    digest = pl.DataFrame(
        {
            "seed": [1, 2] * 2,
            "disabled": [0.0, 0.0, 0.5, 0.5],
            "ended": ["stopped"] * 3 + ["duration"],
            "time_s": [10.0, 20.0, 20.0, None],
            "sim_time_s": [10.0, 20.0, 20.0, 100.0],
        }
    )
    module = find_experiment("resilience", LAYOUT).module
    reading = module.Reading("search", "resilience-search", "time_s")
    share, table = module.efficiency({"resilience-search": digest}, reading)
    assert share.tolist() == [0.0, 0.5]
    assert table == pytest.approx(np.array([[0.1, 0.05], [0.05, 0.01]]) / 0.075)


def test_threshold_rule_deadlocks_in_the_corridor_unless_replaced(tmp_path: Path) -> None:
    done = miniature(
        "threshold", tmp_path, seeds=2, vary={THRESHOLD_COUNT: [4], PARTS: PARTS_HERE}, overrides=["duration_s=40"]
    )
    deadlocked, swings = pl.col("deadlocked.mean"), pl.col("reversals.final")
    crowd, pair = done.runs["article-rule"], done.runs["article-pair"].filter(pl.col(BOUNDARY) == "walls")
    assert sample_of(crowd, deadlocked, RULE).value.mean() > 0.3
    for runs in (crowd, pair):
        assert sample_of(runs, deadlocked, RULE).value.mean() > 0.1
        assert sample_of(runs, swings, RULE).value.mean() > 1.0
        assert sample_of(runs, deadlocked, SMOOTHED).value.mean() < 0.05
        assert sample_of(runs, swings, SMOOTHED).value.max() == 0.0, "the cure never drives backwards"
    assert len(done.figure.axes) == 3
    assert done.numbers.count("the article's rule") == 1 + 4


def test_vicsek_order_falls_with_noise_and_is_exact_for_all_to_all(tmp_path) -> None:
    small = miniature("vicsek", tmp_path, seeds=2, vary={NOISE: [1.0, 4.0]}, overrides=FEWER)
    low, high = (small.runs["vicsek"].sort(NOISE)["order.late"].to_numpy()[at] for at in (slice(0, 2), slice(2, 4)))
    assert low.min() > 0.9
    assert high.max() < 0.7
    alike = small.runs["vicsek-all"]
    expected = all_to_all(alike[NOISE].to_numpy(), 40)
    assert alike["order.late"].to_numpy() == pytest.approx(expected, abs=0.03)
    assert len(small.figure.axes) == 2
    assert "| all hear all | 4 |" in small.numbers


def test_vicsek_correction_for_few_robots_matches_drawn_headings() -> None:
    """100,000 orders of 20 headings: their mean is known to 0.0005 or better."""
    draws = np.random.default_rng(1).uniform(-0.5, 0.5, (100_000, 20)) * 4.0
    order = np.hypot(np.cos(draws).mean(axis=1), np.sin(draws).mean(axis=1)).mean()
    assert order == pytest.approx(all_to_all(4.0, 20), abs=2e-3)
    assert abs(order - all_to_all(4.0)) > 0.02


def test_vicsek_burn_in_is_listed_for_each_campaign() -> None:
    experiment = find_experiment("vicsek", LAYOUT)
    assert set(experiment.module.BURN_IN) == set(experiment.campaigns)


@pytest.mark.slow
@pytest.mark.parametrize(("share", "old", "new"), [(0.28, 0.68, 0.53), (0.32, 0.58, 0.38)])
def test_vicsek_order_depends_on_the_direction_used_for_the_move(share, old, new) -> None:
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


def test_vicsek_reference_takes_the_mean_direction_within_one() -> None:
    draws = np.random.default_rng(2)
    x, y, theta = (draws.uniform(0.0, 5.3, 60) for _ in range(3))
    apart = [along[:, None] - along[None, :] for along in (x, y)]
    near = np.hypot(*(distance - 5.3 * np.round(distance / 5.3) for distance in apart)) <= 1.0
    expected = np.arctan2(near @ np.sin(theta), near @ np.cos(theta))
    assert mean_direction(x, y, theta, 5.3) == pytest.approx(expected)


@pytest.fixture(scope="module")
def corners(tmp_path_factory) -> Mapping[str, pl.DataFrame]:
    """The digests of all campaigns, 4 seeds at the corners of the maps."""
    digests: dict[str, pl.DataFrame] = {}
    for behaviour, duration_s in DURATION_S.items():
        names = [name for name in find_experiment("loss-map", LAYOUT).campaigns if f"-{behaviour}" in name]
        folder = tmp_path_factory.mktemp(behaviour)
        over = [f"duration_s={duration_s}"]
        digests |= miniature("loss-map", folder, seeds=4, vary=CORNERS, overrides=over, campaigns=names).runs
    return digests


@pytest.mark.parametrize("radio", ["", "-bursts"])
@pytest.mark.parametrize("behaviour", ["avoidance", "flocking"])
def test_loss_map_behaviours_need_a_radio_that_is_neither_late_nor_lossy(corners, behaviour, radio):
    _, _, share = shares(results(corners[f"loss-map-{behaviour}{radio}"], behaviour))
    assert share[0, 0] >= 0.75
    assert share[1, 1] <= 0.25


@pytest.mark.parametrize("behaviour", BEHAVIOURS)
def test_loss_map_without_losses_is_equal_for_both_radios(corners, behaviour):
    tables = [results(corners[f"loss-map-{behaviour}{radio}"], behaviour) for radio in ("", "-bursts")]
    first, other = (table.filter(table["loss"] == 0.0) for table in tables)
    assert first.equals(other)


def test_loss_map_radios_lose_equally_in_the_mean(corners):
    for name in ("loss-map-flocking", "loss-map-flocking-bursts"):
        late = results(corners[name], "flocking").filter(loss=0.9, latency_s=0.0)
        assert late["radio.link_pdr"].mean() == pytest.approx(0.1, abs=0.03), name


def test_loss_map_is_drawn_with_all_cells(corners):
    experiment = find_experiment("loss-map", LAYOUT)
    assert len(experiment.draw(corners).axes) == 7  # with the scale
    lines = experiment.numbers(corners).splitlines()
    assert sum(line.startswith("| flocking | ") for line in lines) == 5  # four corners, and the whole map
    assert sum("sent 3 s before" in line for line in lines) == 2
    assert set(CHECKS) <= set(corners)


@pytest.mark.parametrize(
    ("poses", "flock"),
    [
        ([(0, 0, 0), (0.5, 0, 0), (1.0, 0, 0), (1.5, 0, 0)], 1.0),
        ([(0, 0, 0), (0.5, 0, 0), (2.0, 0, 0), (2.5, 0, 0)], 0.5),  # parallel, and apart
        ([(0, 0, 0), (0.5, 0, np.pi), (1.0, 0, 0), (1.5, 0, np.pi)], 0.0),  # together, each its way
    ],
)
def test_loss_map_flock_is_aligned_and_together(poses, flock):
    scenario = load_scenario(LAYOUT.campaigns / "scenarios" / "loss-map-flocking.toml")
    (metric,) = selected_metrics(scenario).metrics
    assert measure(metric, stand(*poses)) == [pytest.approx(flock, abs=1e-9)]

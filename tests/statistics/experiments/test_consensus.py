"""Consensus under loss in small: the mean disagreement decays by the formula, and one-way losses move the average."""

from pathlib import Path

import numpy as np
import pytest

from docs.experiments.figures._consensus_model import graph_of
from docs.experiments.places import HERE
from swarmwire.comms.arrays import FloatArray
from tests.support.experiments.miniature import miniature

SCENARIOS: Path = HERE.campaigns / "scenarios"


def test_the_mean_decays_by_the_formula_and_losses_move_the_average(tmp_path) -> None:
    """Three standard errors of 60 seeds: of six points one is beyond by luck in 2 % of all sets of seeds."""
    small = miniature(
        "consensus",
        tmp_path,
        seeds=60,
        vary={"radio.loss": [0.0, 0.5]},
        overrides=["duration_s=17"],
    )
    for campaign, name, range_m in (("consensus", "consensus", 0.8), ("consensus-random", "consensus-random", None)):
        runs, graph = small.runs[campaign], graph_of(SCENARIOS / f"{name}.toml", range_m)
        for loss in (0.0, 0.5):
            at = runs.filter(runs["radio.loss"] == loss)
            if range_m is not None:
                at = at.filter(at["radio.range_m"] == range_m)
            left, steps = at["first_pattern"].to_numpy(), int(at["steps"][0])
            error = 3.0 * left.std() / np.sqrt(len(left)) + 1e-6
            assert left.mean() == pytest.approx(graph.decay(loss) ** steps, abs=error)
            assert np.sqrt((at["consensus_bias"].to_numpy() ** 2).mean()) == pytest.approx(
                graph.after(steps, loss).bias, rel=0.3, abs=1e-6
            )
    assert len(small.figure.axes) == 2
    assert "| ring of 10 | 0.5 |" in small.told


def drawn(graph, loss: float, steps: int, seed: int) -> FloatArray:
    """Values after so many steps with losses drawn here, (n,)."""
    draws, x = np.random.default_rng(seed), graph.start.copy()
    for _ in range(steps):
        received = graph.adjacency * (draws.random(graph.adjacency.shape) >= loss)
        x = x + graph.gain * (received @ x - received.sum(axis=1) * x)
    return x


def test_exact_moments_are_those_of_drawn_losses() -> None:
    graph = graph_of(SCENARIOS / "consensus.toml", 3.0)
    values = np.array([drawn(graph, 0.6, 5, seed) for seed in range(4000)])
    exact = graph.after(5, 0.6)
    assert np.sqrt((values.mean(axis=1) ** 2).mean()) == pytest.approx(exact.bias, rel=0.05)
    assert np.sqrt(values.var(axis=1).mean()) == pytest.approx(exact.error, rel=0.01)
    assert values.mean(axis=0) == pytest.approx(graph.start * exact.pattern, abs=0.01)


def test_graphs_are_those_that_their_scenarios_describe() -> None:
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

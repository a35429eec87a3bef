"""Algebraic connectivity: known graphs, and all eigenvalues of a Laplacian that is made by another way."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmwire.metrics.metrics import Metrics
from swarmwire.metrics.network.algebraic_connectivity import AlgebraicConnectivity, second_eigenvalue
from tests.support.metrics.truths import edges, measured, static, truth

NAME = "algebraic_connectivity"
PATH = [(i, i + 1) for i in range(200)]
KNOWN = {
    "complete": (lambda n: [(a, b) for b in range(n) for a in range(b)], lambda n: n),
    "ring": (lambda n: [(0, n - 1), *PATH[: n - 1]], lambda n: 2 * (1 - np.cos(2 * np.pi / n))),
    "path": (lambda n: PATH[: n - 1], lambda n: 2 * (1 - np.cos(np.pi / n))),
    "star": (lambda n: [(0, i) for i in range(1, n)], lambda _: 1),
    "cocktail party": (lambda n: [(a, b) for b in range(n) for a in range(b) if a // 2 != b // 2], lambda n: n - 2),
}


@pytest.mark.parametrize("most_dense", [100, 2], ids=["dense", "sparse"])
@pytest.mark.parametrize("nodes", [4, 10, 24, 150])
@pytest.mark.parametrize("kind", KNOWN)
def test_it_is_that_of_known_graphs(kind, nodes, most_dense):
    made, expected = KNOWN[kind]
    assert second_eigenvalue(edges(*made(nodes)), nodes, most_dense) == pytest.approx(expected(nodes), abs=2e-9)


def brute_force(pairs, alive):
    """Laplacian as the sum of (e_a - e_b)(e_a - e_b)^T over edges, of the robots alive alone."""
    n = len(alive)
    total = np.zeros((n, n))
    for a, b in pairs:
        away = np.eye(n)[a] - np.eye(n)[b]
        total += np.outer(away, away)
    living = np.flatnonzero(alive)
    return np.sort(np.linalg.eigvals(total[np.ix_(living, living)]).real)[1] if len(living) > 1 else np.nan


@st.composite
def graphs(draw):
    """Some arenas of the same number of robots: of each who is alive, and edges among them."""
    robots, arenas = draw(st.integers(1, 9)), draw(st.integers(1, 3))
    found = []
    for _ in range(arenas):
        alive = draw(st.lists(st.booleans() | st.just(True), min_size=robots, max_size=robots))
        every = [(a, b) for a in range(robots) for b in range(a + 1, robots) if alive[a] and alive[b]]
        found.append((alive, sorted(draw(st.lists(st.sampled_from(every), unique=True))) if every else []))
    return robots, found


@settings(max_examples=60)
@given(graphs())
def test_it_is_that_of_each_arenas_robots_alive(drawn):
    robots, arenas = drawn
    of = static(robots, arenas=len(arenas))
    alive = np.array([one for own, _ in arenas for one in own])
    pairs = edges(*((i * robots + a, i * robots + b) for i, (_, own) in enumerate(arenas) for a, b in own))
    expected = [brute_force(own, living) for living, own in arenas]
    assert measured(NAME, of, truth(of, alive=alive, edges=pairs)) == pytest.approx(expected, abs=1e-8, nan_ok=True)


def test_without_a_radio_or_a_second_robot_alive_there_is_none():
    without, lone = static(3, arenas=2, radio=False), static(1)
    assert np.isnan(measured(NAME, without, truth(without))).all()
    assert np.isnan(measured(NAME, lone, truth(lone, edges=edges()))).all()


def test_of_a_large_swarm_both_ways_find_the_same():
    of, rng = static(130), np.random.default_rng(4)
    place = rng.uniform(0, np.sqrt(130), (130, 2))
    near = np.argwhere(np.hypot(*(place[:, None] - place[None]).transpose(2, 0, 1)) < 2.0)
    pairs = near[near[:, 0] < near[:, 1]]
    [found] = measured(NAME, of, truth(of, edges=pairs))
    assert found == pytest.approx(brute_force(pairs, np.ones(130, np.bool_)), abs=1e-8)
    assert found == second_eigenvalue(pairs, 130, most_dense=130)
    assert found > 0.01


def test_it_is_sampled_and_held():
    of, metrics = static(3), Metrics([AlgebraicConnectivity(every_s=0.2)])
    metrics.begin(of)
    found = []
    for tick in range(4):
        metrics.see(truth(of, tick, edges=edges((0, 1), (1, 2)) if tick < 1 else edges()))
        found += metrics.latest[NAME].tolist()
    assert found == [1.0, 1.0, 0.0, 0.0]

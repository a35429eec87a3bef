"""The radio graph: components, connectivity and articulation points, and when it falls apart and is whole again."""

from statistics import median

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.measures.network.connectivity import AlgebraicConnectivity, cut_vertices, second_eigenvalue
from swarmwire.metrics.measures.network.fragmentation import (
    Fragmentations,
    Fragmented,
    RejoinMedian,
    RejoinWorst,
    Unrejoined,
)
from tests.support.metrics.truths import edges, in_each_tick, measured, static, truth, watch


def components(run, **given_fields):
    tick = truth(run, **given_fields)
    return measured("components", run, tick), measured("largest_component", run, tick)


@given(st.lists(st.tuples(st.integers(0, 11), st.integers(0, 11)), max_size=30))
def test_components_are_those_found_by_merging(pairs):
    piece = list(range(12))
    for a, b in pairs:
        piece = [piece[a] if p == piece[b] else p for p in piece]
    sizes = [piece.count(p) for p in set(piece)]
    assert components(static(12), edges=edges(*pairs)) == ([float(len(sizes))], [max(sizes) / 12])


CONNECTIVITY = "algebraic_connectivity"
PATH = [(i, i + 1) for i in range(200)]
EXACT = {
    "complete": (lambda n: [(a, b) for b in range(n) for a in range(b)], lambda n: n),
    "ring": (lambda n: [(0, n - 1), *PATH[: n - 1]], lambda n: 2 * (1 - np.cos(2 * np.pi / n))),
    "path": (lambda n: PATH[: n - 1], lambda n: 2 * (1 - np.cos(np.pi / n))),
    "star": (lambda n: [(0, i) for i in range(1, n)], lambda _: 1),
    "cocktail party": (lambda n: [(a, b) for b in range(n) for a in range(b) if a // 2 != b // 2], lambda n: n - 2),
}


@pytest.mark.parametrize("max_dense", [100, 2], ids=["dense", "sparse"])
@pytest.mark.parametrize("nodes", [4, 10, 24, 150])
@pytest.mark.parametrize("kind", EXACT)
def test_connectivity_is_that_of_known_graphs(kind, nodes, max_dense):
    made, expected = EXACT[kind]
    assert second_eigenvalue(edges(*made(nodes)), nodes, max_dense) == pytest.approx(expected(nodes), abs=2e-9)


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
    states = []
    for _ in range(arenas):
        alive = draw(st.lists(st.booleans() | st.just(True), min_size=robots, max_size=robots))
        every = [(a, b) for a in range(robots) for b in range(a + 1, robots) if alive[a] and alive[b]]
        states.append((alive, sorted(draw(st.lists(st.sampled_from(every), unique=True))) if every else []))
    return robots, states


@settings(max_examples=60)
@given(graphs())
def test_connectivity_is_that_of_each_arenas_robots_alive(drawn):
    robots, arenas = drawn
    run = static(robots, arenas=len(arenas))
    alive = np.array([one for own, _ in arenas for one in own])
    pairs = edges(*((i * robots + a, i * robots + b) for i, (_, own) in enumerate(arenas) for a, b in own))
    expected = [brute_force(own, living) for living, own in arenas]
    assert measured(CONNECTIVITY, run, truth(run, alive=alive, edges=pairs)) == pytest.approx(
        expected, abs=1e-8, nan_ok=True
    )


def test_connectivity_of_a_large_swarm_is_the_same_dense_and_sparse():
    run, rng = static(130), np.random.default_rng(4)
    position = rng.uniform(0, np.sqrt(130), (130, 2))
    near = np.argwhere(np.hypot(*(position[:, None] - position[None]).transpose(2, 0, 1)) < 2.0)
    pairs = near[near[:, 0] < near[:, 1]]
    [connectivity] = measured(CONNECTIVITY, run, truth(run, edges=pairs))
    assert connectivity == pytest.approx(brute_force(pairs, np.ones(130, np.bool_)), abs=1e-8)
    assert connectivity == second_eigenvalue(pairs, 130, max_dense=130)
    assert connectivity > 0.01


def test_connectivity_is_held_between_its_samples():
    run = static(3)
    ticks = (truth(run, tick, edges=edges((0, 1), (1, 2)) if tick < 1 else edges()) for tick in range(4))
    assert in_each_tick(run, ticks, AlgebraicConnectivity(every_s=0.2)).ravel().tolist() == [1.0, 1.0, 0.0, 0.0]


NAME = "articulation"


def points(run, pairs, **fields):
    return measured(NAME, run, truth(run, edges=edges(*pairs), **fields))


def pieces(nodes, pairs):
    piece = {node: node for node in nodes}
    for a, b in pairs:
        if a in piece and b in piece:
            piece = {node: piece[a] if p == piece[b] else p for node, p in piece.items()}
    return len(set(piece.values()))


@settings(max_examples=60)
@given(st.lists(st.lists(st.tuples(st.integers(0, 7), st.integers(0, 7)), max_size=14), min_size=1, max_size=3))
def test_articulation_points_are_those_without_which_there_are_more_pieces(drawn):
    arenas = [sorted({(min(pair), max(pair)) for pair in own if pair[0] != pair[1]}) for own in drawn]
    expected = []
    for own in arenas:
        total = pieces(range(8), own)
        # A robot that stood alone takes its own piece with it.
        expected.append(sum(pieces(set(range(8)) - {robot}, own) > total for robot in range(8)))
    pairs = [(8 * i + a, 8 * i + b) for i, own in enumerate(arenas) for a, b in own]
    assert points(static(8, arenas=len(arenas)), pairs) == expected


def test_articulation_points_of_a_large_swarm_are_those_of_networkx():
    for seed, reach in ((1, 1.0), (2, 1.2), (3, 1.4)):
        at = np.random.default_rng(seed).uniform(0, 20, (400, 2))
        pairs = np.argwhere(np.triu(np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1)) < reach, 1))
        expected = sorted(nx.articulation_points(nx.Graph(pairs.tolist())))
        assert np.flatnonzero(cut_vertices(pairs, 400)).tolist() == expected
        assert len(expected) > 5


NAMES = ("fragmentations", "rejoin_median", "rejoin_worst", "unrejoined")
KINDS = (Fragmentations, RejoinMedian, RejoinWorst, Unrejoined)
JOINED, SPLIT = edges((0, 1)), edges()


def events_of(ticks, hold):
    """The length of each event in ticks, of a string as `seen_ticks` takes it; None: open at the end."""
    connected = [tick for tick, shown in enumerate(ticks) if shown == "+"]
    times = []
    for this, following in zip(connected, [*connected[1:], None], strict=False):
        apart = [tick for tick in range(this, following or len(ticks)) if ticks[tick] == "-"]
        if apart and apart[-1] - apart[0] >= hold:
            times.append(following - apart[0] if following else None)
    return times


def seen_ticks(run, ticks):
    """Of one arena with two robots: + joined, - apart, 0 all dead; at 10 ticks per second."""
    for tick, shown in enumerate(ticks):
        yield truth(run, tick, edges=JOINED if shown == "+" else SPLIT, alive=np.full(2, shown != "0"))


def finals(ticks, hold_s=None):
    """What the four metrics say in the end of ticks as `seen_ticks` takes them."""
    run = static(2)
    metrics = Metrics(list(NAMES) if hold_s is None else [kind(hold_s=hold_s) for kind in KINDS])
    watch(run, seen_ticks(run, ticks), metrics)
    [summary] = metrics.end(None)["metrics"]
    return tuple(summary[name]["final"] for name in NAMES)


NO_EVENT = (0.0, None, None, None)


@pytest.mark.parametrize(
    ("ticks", "hold_s", "exact"),
    [
        ("+" * 30, None, NO_EVENT),
        ("++" + "-" * 10 + "++", None, NO_EVENT),  # shorter than the hold
        ("++" + "-" * 11 + "++", None, (1.0, 1.1, 1.1, 0.0)),  # its length counts from its start
        ("+" + "".join("-" * n + "+" for n in (12, 30, 15, 5)), None, (3.0, 1.5, 3.0, 0.0)),
        ("+" + "-" * 20 + "+" + "-" * 40, None, (2.0, 2.0, 2.0, 0.5)),
        ("+" + "-" * 40, None, (1.0, None, None, 1.0)),
        ("+-+--+---", 0.0, (3.0, pytest.approx(0.15), 0.2, pytest.approx(1 / 3))),
        ("+" + "-" * 30 + "+", 3.1, NO_EVENT),
        ("-" * 30 + "+" * 5, None, NO_EVENT),  # it starts in pieces
        ("-" * 30 + "+" + "-" * 12 + "+", None, (1.0, 1.2, 1.2, 0.0)),
        ("+" + "-" * 15 + "0" * 10, None, (1.0, None, None, 1.0)),  # who died has not re-joined
    ],
)
def test_known_swarms_have_their_events(ticks, hold_s, exact):
    assert finals(ticks, hold_s) == exact


@given(st.text("+-0", max_size=60) | st.text("++----0", max_size=60), st.integers(0, 4))
def test_events_are_those_read_off_the_ticks(ticks, hold):
    lengths = events_of(ticks, hold)
    over = [length / 10 for length in lengths if length is not None]
    expected = (
        len(lengths) if ticks else None,
        pytest.approx(median(over)) if over else None,
        max(over) if over else None,
        pytest.approx(1 - len(over) / len(lengths)) if lengths else None,
    )
    assert finals(ticks, hold_s=hold / 10) == expected


@given(st.text("+++-----0", min_size=1, max_size=60), st.integers(0, 4))
def test_fragmented_is_the_share_of_the_time_in_events_without_their_holds(ticks, hold):
    run = static(2)
    values = in_each_tick(run, seen_ticks(run, ticks), Fragmented(hold_s=hold / 10)).ravel().tolist()
    assert set(values) <= {0.0, 1.0}
    starts = [tick for tick, (before, now) in enumerate(zip([0.0, *values], values, strict=False)) if now > before]
    lengths = events_of(ticks, hold)
    assert len(starts) == len(lengths)
    closed = sum(length - hold for length in lengths if length is not None)
    still_open = len(ticks) - starts[-1] if lengths and lengths[-1] is None else 0
    # Who all died within the hold is counted at the first split tick after it, which is later than the hold.
    assert sum(values) == closed + still_open if "0" not in ticks else sum(values) <= closed + still_open

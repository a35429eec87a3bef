"""Articulation: known graphs, and components counted after taking out each robot in turn."""

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmwire.metrics.network.articulation import cut_vertices
from tests.support.metrics.truths import edges, measured, static, truth

NAME = "articulation"


def points(of, pairs, **fields):
    return measured(NAME, of, truth(of, edges=edges(*pairs), **fields))


def test_known_graphs():
    path = [(i, i + 1) for i in range(5)]
    assert points(static(6), path) == [4.0]
    assert points(static(6), [*path, (0, 5)]) == [0.0]
    assert points(static(6), [(0, i) for i in range(1, 6)]) == [1.0]
    assert points(static(6), [(a, b) for b in range(6) for a in range(b)]) == [0.0]
    assert points(static(6), [(0, 1), (1, 2), (0, 2), (3, 4), (4, 5), (3, 5), (2, 3)]) == [2.0]  # a bridge has two ends
    assert points(static(6), []) == [0.0]


def test_without_a_radio_or_a_robot_alive_there_is_none():
    of = static(2, radio=False)
    assert np.isnan(measured(NAME, of, truth(of))).all()
    two = static(3, arenas=2)
    alive = np.array([False] * 3 + [True] * 3)
    assert points(two, [(3, 4), (4, 5)], alive=alive) == pytest.approx([np.nan, 1.0], nan_ok=True)


def pieces(nodes, pairs):
    piece = {node: node for node in nodes}
    for a, b in pairs:
        if a in piece and b in piece:
            piece = {node: piece[a] if p == piece[b] else p for node, p in piece.items()}
    return len(set(piece.values()))


@settings(max_examples=60)
@given(st.lists(st.lists(st.tuples(st.integers(0, 7), st.integers(0, 7)), max_size=14), min_size=1, max_size=3))
def test_they_are_those_without_which_there_are_more_pieces(drawn):
    arenas = [sorted({(min(pair), max(pair)) for pair in own if pair[0] != pair[1]}) for own in drawn]
    expected = []
    for own in arenas:
        whole = pieces(range(8), own)
        # A robot that stood alone takes its own piece with it.
        expected.append(sum(pieces(set(range(8)) - {robot}, own) > whole for robot in range(8)))
    pairs = [(8 * i + a, 8 * i + b) for i, own in enumerate(arenas) for a, b in own]
    assert points(static(8, arenas=len(arenas)), pairs) == expected


def test_of_a_large_swarm_they_are_those_that_networkx_finds():
    for seed, reach in ((1, 1.0), (2, 1.2), (3, 1.4)):
        at = np.random.default_rng(seed).uniform(0, 20, (400, 2))
        pairs = np.argwhere(np.triu(np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1)) < reach, 1))
        expected = sorted(nx.articulation_points(nx.Graph(pairs.tolist())))
        assert np.flatnonzero(cut_vertices(pairs, 400)).tolist() == expected
        assert len(expected) > 5

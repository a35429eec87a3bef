import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tests.support.metrics.truths import edges, measured, static, truth


def pieces(of, **given_fields):
    seen = truth(of, **given_fields)
    return measured("components", of, seen), measured("largest_component", of, seen)


def test_a_ring_is_one_component():
    of = static(6)
    assert pieces(of, edges=edges(*[(i, (i + 1) % 6) for i in range(6)])) == ([1.0], [1.0])


def test_a_split_swarm_counts_its_pieces_and_the_share_of_the_largest():
    assert pieces(static(8), edges=edges((0, 1), (1, 2), (3, 4), (4, 5), (5, 6))) == ([3.0], [0.5])


def test_without_edges_every_robot_is_a_component():
    assert pieces(static(4), edges=edges()) == ([4.0], [0.25])


def test_dead_robots_are_no_component_and_not_in_the_share():
    alive = np.array([True, True, True, False])
    assert pieces(static(4), alive=alive, edges=edges((0, 1))) == ([2.0], [2 / 3])


def test_without_a_robot_alive_there_are_no_components_and_no_largest():
    count, largest = pieces(static(2), alive=np.zeros(2, np.bool_), edges=edges())
    assert count == [0.0]
    assert np.isnan(largest).all()


def test_without_a_radio_there_is_no_radio_graph():
    count, largest = pieces(static(2, arenas=2, radio=False))
    assert np.isnan(count).all()
    assert np.isnan(largest).all()


def test_arenas_are_counted_apart():
    of = static(3, arenas=3)
    assert pieces(of, edges=edges((0, 1), (1, 2), (6, 8))) == ([1.0, 3.0, 2.0], [1.0, 1 / 3, 2 / 3])


@given(st.lists(st.tuples(st.integers(0, 11), st.integers(0, 11)), max_size=30))
def test_components_are_those_found_by_merging(pairs):
    piece = list(range(12))
    for a, b in pairs:
        piece = [piece[a] if p == piece[b] else p for p in piece]
    sizes = [piece.count(p) for p in set(piece)]
    assert pieces(static(12), edges=edges(*pairs)) == ([float(len(sizes))], [max(sizes) / 12])

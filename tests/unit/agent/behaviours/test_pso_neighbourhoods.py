"""Particle swarm search: whose bests count, and for how long."""

from typing import Any

import pytest

from swarmwire.agent.behaviours import PsoModel, PsoSearch, PsoSearchPositioned
from swarmwire.agent.declared import BadParameter, checked
from swarmwire.agent.testing import Trial, assert_rows_independent
from tests.support.agent.behaviours.one_particle import One, place

OFTEN = {"update_every_ticks": 3, "tell_before_ticks": 1}
RING = {"ring_count": 7, "ring_index": [0, 1, 2, 3, 4, 5, 6]}


@pytest.mark.parametrize(
    ("index", "width", "heeded"), [(0, 1, 9), (0, 4, 6), (0, 5, 5), (4, 1, 5), (3, 1, 4), (2, 2, 4)]
)
def test_on_a_ring_only_those_next_to_a_robot_count(index: int, width: int, heeded: int) -> None:
    """Of senders 1 to 9 the nearer to 5 is the brighter, above 5 a little more so than below."""
    one = One(ring_count=10, ring_index=index, ring_width=width)
    one.step(*(place(8.0 - abs(sender - 5.1), float(sender), 0.0) for sender in range(1, 10)))
    assert one.vector("best")[0] == pytest.approx(heeded - 1.0)


def test_without_a_ring_all_who_are_heard_count() -> None:
    one = One()
    one.step(*(place(8.0 - abs(sender - 5.1), float(sender), 0.0) for sender in range(1, 10)))
    assert one.vector("best")[0] == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("params", "key", "text"),
    [
        ({"ring_count": -1}, "ring_count", "expected 0 .no ring. or how many"),
        ({"ring_count": 10, "ring_width": 0}, "ring_width", "at least 1 neighbour on each side, got 0"),
        ({"ring_count": 10}, "ring_index", "a list with the index in the arena of each robot, 0 to 9, got 0"),
        ({"ring_count": 2, "ring_index": [0, 1, 2]}, "ring_index", "0 to 1, got"),
        ({"ring_count": 3, "ring_index": [0, 1]}, "ring_index", "one for each of the 3 robots"),
    ],
)
def test_what_is_no_ring_is_refused_before_anything_runs(params: dict[str, Any], key: str, text: str) -> None:
    with pytest.raises(BadParameter, match=text) as caught:
        checked(PsoSearch, params, robots=3)
    assert caught.value.key == key


def test_the_ring_of_a_class_by_default_is_checked_as_one_that_is_given() -> None:
    class Ringed(PsoSearch):
        ring_count: int = 10

    with pytest.raises(BadParameter, match="0 to 9, got 0"):
        checked(Ringed, {}, robots=3)
    assert checked(Ringed, {"ring_index": [0, 1, 9]}, robots=3) == {"ring_index": [0, 1, 9]}
    assert checked(Ringed, {"ring_count": 0}, robots=3) == {"ring_count": 0}


def test_one_robot_of_a_ring_is_told_its_index_alone() -> None:
    assert checked(PsoSearch, {"ring_count": 3, "ring_index": 2})["ring_index"] == 2


def test_what_was_heard_is_forgotten_after_the_update_that_it_was_told_for_unless_it_is_kept() -> None:
    kept, asked = One(), One(keeps_heard=False)
    for one in (kept, asked):
        one.steps(199)
        one.step(place(9.0, 2.0, 2.0))
        assert one.memory.best_brightness[0] == 9.0
        one.step()
    assert kept.vector("velocity") == asked.vector("velocity")
    assert kept.memory.best_brightness[0] == 9.0
    assert asked.memory.best_brightness[0] < 0.0


@pytest.mark.parametrize("kind", [PsoSearch, PsoSearchPositioned, PsoModel])
@pytest.mark.parametrize("more", [{}, RING, {"keeps_heard": False, "again_m": 0.5}])
def test_each_robot_decides_for_itself(kind: Any, more: dict[str, Any]) -> None:
    assert_rows_independent(kind, Trial(body="epuck-gps", params={**OFTEN, **more}))

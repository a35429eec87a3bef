"""A slot's state changes by the moves of the table alone: any other raises and changes nothing."""

from typing import get_args

import pytest

from swarmwire.world.backends.allocation import MOVES, Allocation, Move, State
from tests.support.agent.hosts import assignment, group

STATES, EVERY_MOVE = get_args(State), get_args(Move)
PAIRS = [(state, move) for state in STATES for move in EVERY_MOVE]


def slot(state: State) -> Allocation:
    its = assignment(group("unused:Agent", [0]))
    return Allocation(its, its.groups[0].rows, "somebody", state)


@pytest.mark.parametrize(("state", "move"), PAIRS)
def test_a_move_of_the_table_leads_where_it_says_and_any_other_raises_and_changes_nothing(state, move) -> None:
    it = slot(state)
    before = vars(it).copy()
    if move in MOVES[state]:
        it.move(move)
        assert vars(it) == before | {"state": MOVES[state][move]}
    else:
        with pytest.raises(RuntimeError, match=f"{state} has no move '{move}'"):
            it.move(move)
        assert vars(it) == before


def test_every_state_stands_in_the_table_and_can_be_reached() -> None:
    assert set(MOVES) == set(STATES)
    reached = set(STATES[:1])
    while more := {to for state in reached for to in MOVES[state].values()} - reached:
        reached |= more
    assert reached == set(STATES)
    assert {move for moves in MOVES.values() for move in moves} == set(EVERY_MOVE)

import numpy as np

from swarmwire.comms.tick_io import MAX_STATES, SparseTable
from swarmwire.world.annotations import States

ALIVE = np.ones(6, np.bool_)


def notes(*named: tuple[int, str]) -> SparseTable:
    names = tuple(dict.fromkeys(state for _, state in named))
    rows = np.array([row for row, _ in named], np.int64)
    return SparseTable(rows, np.zeros_like(rows), np.array([names.index(state) for _, state in named], float), names)


def shown(states: States) -> list[str]:
    return [states.names[code] for code in states.code]


def test_a_state_holds_until_the_next_is_named():
    states = States(1, 6)
    states.take(notes((1, "search"), (4, "wait")), ALIVE)
    states.take(notes((4, "search")), ALIVE)
    assert shown(states) == ["", "search", "", "", "search", ""]


def test_new_states_are_numbered_by_row_whatever_the_order_and_division_of_the_notes():
    together, joined = States(1, 6), States(1, 6)
    together.take(notes((5, "c"), (0, "b"), (3, "a")), ALIVE)
    joined.take(SparseTable.joined([notes((3, "a")), notes((5, "c"), (0, "b"))]), ALIVE)
    assert together.names == joined.names == ("", "b", "a", "c")
    assert together.code.tolist() == joined.code.tolist()


def test_the_dead_name_nothing_and_the_revived_start_afresh():
    states, dead = States(1, 6), ALIVE.copy()
    dead[2] = False
    states.take(notes((2, "search"), (3, "search")), dead)
    assert shown(states) == ["", "", "", "search", "", ""]
    states.forget(np.arange(6) == 3)
    assert shown(states) == [""] * 6


def test_too_many_states_are_counted_and_leave_the_last_one():
    states = States(1, 1)
    for i in range(MAX_STATES + 3):
        states.take(notes((0, f"s{i}")), ALIVE[:1])
    assert (states.dropped.tolist(), shown(states)) == ([3], [f"s{MAX_STATES - 1}"])


def test_what_was_shown_is_not_written_to():
    states = States(1, 6)
    before = states.code
    states.take(notes((1, "search")), ALIVE)
    assert before.tolist() == [0] * 6


def test_each_arena_has_its_own_limit_so_that_it_is_beside_others_as_alone():
    states = States(2, 3)
    for i in range(MAX_STATES + 2):
        states.take(notes((0, f"a{i}"), (4, f"b{i % 3}")), ALIVE)
    states.take(notes((1, "b0"), (5, "a0"), (3, "new")), ALIVE)
    assert states.dropped.tolist() == [3, 0]
    assert shown(states)[1] == ""
    assert shown(states)[3:] == ["new", f"b{(MAX_STATES + 1) % 3}", "a0"]
    assert len(set(states.names)) == len(states.names)

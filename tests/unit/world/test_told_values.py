import numpy as np

from swarmwire.comms.tick_io import NOTHING_SET, SparseTable
from swarmwire.world.annotations import LatestValues

ALIVE = np.ones(4, np.bool_)


def told(*numbers: tuple[int, float]) -> SparseTable:
    rows, value = zip(*numbers, strict=True)
    return SparseTable(np.array(rows, np.int64), np.zeros(len(rows), np.int64), np.array(value, np.float64))


def shown(values: LatestValues) -> list[float | None]:
    assert values.value is not None
    return [None if np.isnan(value) else float(value) for value in values.value]


def test_a_number_holds_until_the_next_is_told() -> None:
    values = LatestValues()
    values.take(NOTHING_SET, ALIVE)
    assert values.value is None
    values.take(told((1, 2.5), (3, -1.0)), ALIVE)
    values.take(told((3, 0.0)), ALIVE)
    values.take(NOTHING_SET, ALIVE)
    assert shown(values) == [None, 2.5, None, 0.0]


def test_of_two_numbers_of_a_robot_the_later_counts() -> None:
    values = LatestValues()
    values.take(SparseTable.joined([told((2, 1.0)), NOTHING_SET, told((0, 5.0), (2, 2.0))]), ALIVE)
    assert shown(values) == [5.0, None, 2.0, None]


def test_the_dead_tell_nothing_and_the_revived_start_afresh() -> None:
    values, dead = LatestValues(), ALIVE.copy()
    dead[2] = False
    values.forget(~dead)
    values.take(told((2, 1.0)), dead)
    assert values.value is None
    values.take(told((2, 1.0), (3, 1.0)), dead)
    assert shown(values) == [None, None, None, 1.0]
    values.forget(np.arange(4) == 3)
    assert shown(values) == [None] * 4


def test_what_was_shown_is_not_written_to() -> None:
    values = LatestValues()
    values.take(told((1, 1.0)), ALIVE)
    before = values.value
    values.take(told((1, 2.0)), ALIVE)
    assert before is not None
    assert before[1] == 1.0

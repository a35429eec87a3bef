"""What a VectorAgent holds: a Memory, whose columns the framework owns, and parameters with a value per robot."""

from typing import Any, ClassVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.agent import (
    Agent,
    BoolColumn,
    FloatColumn,
    IntColumn,
    Memory,
    PerRobot,
    Robots,
    VectorAgent,
    column,
    parameter,
)
from swarmwire.agent.agent_group import agent_group
from swarmwire.agent.parameters import BadParameter, checked_parameters, parameters_of
from swarmwire.agent.testing import Trial, assert_rows_independent
from swarmwire.agent.vector_agent import memory_class
from swarmwire.comms.robot.packets import ReceivedPackets
from tests.support.agent.hosts import group, readings
from tests.support.agent.players import Crowd, Steps, Table, VectorCounter

rows_ = st.lists(st.integers(0, 9), unique=True).map(sorted)


def test_memory_of_a_new_robot_has_the_defaults_in_its_own_arrays() -> None:
    memory, other = Table.fresh(3), Table.fresh(3)
    other.x += 1.0
    assert (memory.x.tolist(), memory.n.tolist()) == ([0.5] * 3, [-1] * 3)
    assert (memory.x.dtype, memory.n.dtype) == (np.float64, np.int64)
    assert len(Table.fresh(0).x) == 0


def test_memory_column_assignment_copies() -> None:
    memory = Table.fresh(2)
    held, given_array = memory.x, np.array([1.0, 2.0])
    memory.x = given_array
    given_array[0] = 9.0
    assert memory.x is held
    assert held.tolist() == [1.0, 2.0]
    memory.n = 7
    assert memory.n.tolist() == [7, 7]
    memory.n += 1
    assert memory.n.dtype == np.int64
    with pytest.raises(ValueError):
        memory.x = np.zeros(3)


def test_wide_column_has_several_numbers_per_robot_and_moves_with_it() -> None:
    class Wide(Memory):
        slots: IntColumn = column(-1, width=3)

    memory = Wide.fresh(2)
    assert memory.slots.tolist() == [[-1] * 3] * 2
    memory.slots[1] = [4, 5, 6]
    moved = memory.moved(np.array([2, 7]), np.array([5, 7]))
    assert moved.slots.tolist() == [[-1] * 3, [4, 5, 6]]
    memory.slots = 8
    assert memory.slots.tolist() == [[8] * 3] * 2


def test_unknown_column_is_refused() -> None:
    memory = Table.fresh(1)
    with pytest.raises(AttributeError, match="Table has no column 'y'; it has x, n"):
        memory.y = 1.0
    with pytest.raises(AttributeError):
        memory.columns = {}


@pytest.mark.parametrize(
    ("hints", "values", "fault"),
    [
        ({"x": float}, {"x": column(0.0)}, r"Odd\.x: expected FloatColumn"),
        ({"x": FloatColumn}, {}, r"Odd\.x: expected FloatColumn"),
        ({"x": FloatColumn}, {"x": 0.0}, r"Odd\.x: expected FloatColumn"),
        ({"moved": FloatColumn}, {"moved": column(0.0)}, r"Odd\.moved: .*reserved"),
    ],
)
def test_column_of_another_type_or_a_reserved_name_is_refused(hints: Any, values: Any, fault: str) -> None:
    with pytest.raises(TypeError, match=fault):
        type("Odd", (Memory,), {"__annotations__": hints, **values})


def test_column_refuses_values_that_it_cannot_represent() -> None:
    memory = Table.fresh(2)
    with pytest.raises(TypeError, match=r"Table\.n: expected int64, got float64"):
        memory.n = memory.n + 0.5
    with pytest.raises(TypeError):
        memory.n = 1.5
    assert memory.n.tolist() == [-1, -1]
    memory.x = 3
    assert memory.x.tolist() == [3.0, 3.0]


def test_memory_inherits_columns_without_changing_its_base() -> None:
    class More(Table):
        charged: BoolColumn = column(False)
        n: IntColumn = column(4)

    assert list(More.columns) == ["x", "n", "charged"]
    assert list(Table.columns) == ["x", "n"]
    assert More.fresh(1).n.tolist() == [4]
    assert Table.fresh(1).n.tolist() == [-1]
    assert More.fresh(1).charged.dtype == np.bool_


@given(rows_, rows_)
def test_memory_rows_move_with_their_robots(old: list[int], new: list[int]) -> None:
    memory = Table.fresh(len(old))
    memory.n = np.array(old, np.int64) * 10
    moved = memory.moved(np.array(old, np.int64), np.array(new, np.int64))
    assert moved.n.tolist() == [row * 10 if row in old else -1 for row in new]
    assert moved.x.tolist() == [0.5] * len(new)


def test_agent_has_the_memory_of_its_class() -> None:
    derived = type("Derived", (VectorCounter,), {})
    assert [memory_class(kind) for kind in (VectorCounter, derived, Crowd, VectorAgent)] == [
        Steps,
        Steps,
        Memory,
        Memory,
    ]


class Lanes(VectorAgent):
    needs: ClassVar[tuple[str, ...]] = ()
    lane: PerRobot[int]
    speed_mps: PerRobot[float] = parameter(0.02, help="straight ahead")
    gain: float = 2.0

    def step(self, robots: Robots, memory: Memory) -> None:
        assert (self.lane.dtype, self.speed_mps.dtype) == (np.int64, np.float64)
        robots.drive(self.speed_mps, self.gain * self.lane)


def turns(rows: list[int], acting: list[int], **params: Any) -> list[float]:
    agents = agent_group(group("", rows, params=params), Lanes)
    actions = agents.act((0, 0, 10**8), readings(0, acting), ReceivedPackets.none(("range_m", "bearing_rad")))
    assert len(actions.linear_mps) == len(acting)
    return actions.angular_radps.tolist()


def test_parameter_list_shows_the_values_of_acting_robots():
    assert turns([2, 5, 9], [2, 5, 9], lane=[1, 2, 3]) == [2.0, 4.0, 6.0]
    assert turns([2, 5, 9], [9], lane=[1, 2, 3]) == [6.0]
    assert turns([2, 5, 9], [2, 9], lane=4) == [8.0, 8.0]
    assert_rows_independent(Lanes, Trial(robots=7, params={"lane": list(range(7)), "speed_mps": 0.1}))


@pytest.mark.parametrize(
    ("params", "text"),
    [
        ({}, "is missing"),
        ({"lane": [1, 2]}, "a whole number, or a list with one for each of the 3 robots, got a list of 2"),
        ({"lane": [1, 2, 0.5]}, "got 0.5"),
        ({"lane": "1"}, "got '1'"),
        ({"lane": 1, "gain": [1.0, 1.0, 1.0]}, "expected a number, got"),
    ],
)
def test_per_robot_values_of_another_form_are_refused(params, text):
    with pytest.raises(BadParameter, match=text):
        checked_parameters(Lanes, params, 3)


def test_per_robot_parameters_need_a_vector_agent():
    lone = type("Lone", (Agent,), {"__annotations__": {"lane": PerRobot[int]}, "step": lambda *_: None})
    with pytest.raises(TypeError, match="only a VectorAgent"):
        parameters_of(lone)

"""Parameters are typed, and set before an agent is made."""

from typing import Any

import pytest

from swarmwire.agent import Agent, Robot
from swarmwire.agent.behaviours import Flocking
from swarmwire.agent.declared import REQUIRED, BadParameter, checked, make, parameters_of
from tests.support.agent.players import Parametrised, Stateless


def refused(params: dict[str, Any], kind: type = Parametrised) -> BadParameter:
    with pytest.raises(BadParameter) as caught:
        checked(kind, params)
    return caught.value


def test_annotated_attributes_are_the_parameters() -> None:
    declared = parameters_of(Parametrised)
    assert {name: of.type for name, of in declared.items()} == {
        "speed_mps": float,
        "count": int,
        "eager": bool,
        "word": str,
    }
    assert declared["speed_mps"].default is REQUIRED
    assert declared["count"].default == 3
    assert "needs" not in parameters_of(Flocking)


def test_parameters_are_set_before_the_agent_is_made() -> None:
    assert make(Parametrised, {"speed_mps": 0.5}).seen == (0.5, 3, False, "hop")
    full = {"speed_mps": 0.5, "count": 0, "eager": True, "word": ""}
    assert make(Parametrised, full).seen == (0.5, 0, True, "")


def test_one_agents_parameters_are_not_the_others() -> None:
    make(Parametrised, {"speed_mps": 1.0, "count": 9})
    assert make(Parametrised, {"speed_mps": 2.0}).seen == (2.0, 3, False, "hop")


def test_a_whole_number_is_a_number() -> None:
    value = checked(Parametrised, {"speed_mps": 2})["speed_mps"]
    assert type(value) is float
    assert value == 2.0


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("speed_mps", "0.5", "expected a number, got '0.5'"),
        ("speed_mps", True, "expected a number, got True"),
        ("speed_mps", None, "expected a number, got None"),
        ("count", 2.0, "expected a whole number, got 2.0"),
        ("count", True, "expected a whole number, got True"),
        ("eager", 1, "expected true or false, got 1"),
        ("speed_mps", float("nan"), "expected a finite number, got nan"),
        ("speed_mps", float("inf"), "expected a finite number, got inf"),
        ("count", 2**63, "expected a number of at most 64 bits, got 9223372036854775808"),
        ("speed_mps", -(2**63) - 1, "expected a number of at most 64 bits, got -9223372036854775809"),
        ("word", 3, "expected a text, got 3"),
        ("word", ["a"], "expected a text, got ['a']"),
    ],
)
def test_a_value_of_another_type_is_refused(key: str, value: Any, expected: str) -> None:
    error = refused({"speed_mps": 1.0, key: value})
    assert (error.key, error.expected) == (key, expected)


def test_an_unknown_parameter_is_refused_with_those_there_are() -> None:
    error = refused({"speed_mps": 1.0, "sped": 1})
    assert error.key == "sped"
    assert error.expected == (
        "unknown parameter of Parametrised; expected one of speed_mps, count, eager, word (did you mean speed_mps?)"
    )
    assert refused({"x": 1}, Stateless).expected == "unknown parameter of Stateless; expected none"
    assert refused({"speed_mps": 1.0, "needs": 1}).key == "needs"


def test_a_missing_parameter_is_refused() -> None:
    error = refused({})
    assert (error.key, error.expected) == ("speed_mps", "is missing: expected a number")


def test_a_subclass_has_the_parameters_of_its_base_and_its_own_defaults() -> None:
    class Slow(Parametrised):
        speed_mps: float = 0.1
        patience_s: float = 5.0

    assert list(parameters_of(Slow)) == ["speed_mps", "count", "eager", "word", "patience_s"]
    assert make(Slow, {}).seen[0] == 0.1


@pytest.mark.parametrize(("name", "hint", "value"), [("api", int, 1), ("needs", tuple[str, ...], ("compass",))])
def test_what_a_class_says_of_itself_is_no_parameter_however_it_is_annotated(name: str, hint: Any, value: Any) -> None:
    mine = type("Mine", (Agent,), {"__annotations__": {name: hint, "gain": float}, name: value, "gain": 0.5})
    assert list(parameters_of(mine)) == ["gain"]
    with pytest.raises(BadParameter, match="unknown parameter of Mine"):
        checked(mine, {name: value})


def test_private_attributes_are_no_parameters() -> None:
    class Quiet(Agent):
        _memory: list[int]

        def step(self, robot: Robot) -> None: ...

    assert not parameters_of(Quiet)

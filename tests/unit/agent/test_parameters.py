import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from swarmwire.agent import Agent, Robot, parameter
from swarmwire.agent.agent import NoAgent, agent_sha256, load_agent
from swarmwire.agent.agent_group import layout_of
from swarmwire.agent.behaviours import Flocking
from swarmwire.agent.executor import AgentExecutor
from swarmwire.agent.parameters import REQUIRED, BadParameter, checked_parameters, make_agent, parameters_of
from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.base.plugins import resolve
from swarmwire.comms.robot.packets import ReceivedPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.agent_memory import GroupMemories, GroupMemory, decode_memory, encode_memory
from tests.support.agent.hosts import MEASURES, PLAYERS, assignment, group, one_group, plain, spec
from tests.support.agent.players import Parametrised, Stateless

HEAD = "from swarmwire.agent import Agent, Robot, VectorAgent\n"
ROWS = [0, 1, 2, 5, 6]
ASSIGNMENTS = {name: assignment(group(spec(name), ROWS)) for name in ("VectorInsisting", "VectorCounter", "Counter")}
LAYOUT = {"g": {"x": ("<f8", ()), "y": ("<i8", (2,))}}
SOUND: dict[str, Any] = {
    "memory/g/rows": np.array([1, 3]),
    "memory/g/x": np.array([0.5, 1.5]),
    "memory/g/y": np.array([[1, 2], [3, 4]]),
}


NUMBERED = "class Mine(Agent):\n    number = {}\n    def step(self, robot): ...\n"


def refused(text: str) -> str:
    with pytest.raises(NoAgent) as caught:
        load_agent(text)
    return str(caught.value)


def written(directory: Path, code: str) -> str:
    path = directory / "mine.py"
    path.write_text(HEAD + code, encoding="utf-8")
    return f"{path}:Mine"


def test_agent_sha256_identifies_the_source_file(tmp_path) -> None:
    sha256 = agent_sha256(load_agent(spec("Counter")))
    assert sha256 == hashlib.sha256(PLAYERS.read_bytes()).hexdigest() == agent_sha256(load_agent(spec("Chatter")))
    copy = tmp_path / "mine.py"
    copy.write_bytes(PLAYERS.read_bytes() + b"\n")
    assert agent_sha256(load_agent(f"{copy}:Counter")) != sha256
    copy.unlink()
    with pytest.raises(NoAgent, match="comes from no file that can be read"):
        agent_sha256(type("Typed", (Flocking,), {"__module__": "__main__x"}))


def test_agent_class_is_loaded_once_from_a_module_or_file(tmp_path: Path) -> None:
    assert load_agent("swarmwire.agent.behaviours:Flocking") is Flocking
    kind = load_agent(spec("Counter"))
    assert kind.__name__ == "Counter"
    assert load_agent(spec("Counter")) is kind
    specs: list[str] = []
    for number in (1, 2):  # files of the same name
        (tmp_path / str(number)).mkdir()
        specs.append(written(tmp_path / str(number), NUMBERED.format(number)))
    assert [vars(load_agent(text))["number"] for text in specs] == [1, 2]


def test_agent_file_is_relative_to_the_scenario_and_a_module_is_not(tmp_path: Path) -> None:
    assert resolve("../agents/mine.py:Mine", tmp_path / "scenarios") == f"{tmp_path.resolve()}/agents/mine.py:Mine"
    assert resolve("a.b:Mine", tmp_path) == "a.b:Mine"
    assert resolve(spec("Counter"), tmp_path) == f"{PLAYERS.resolve()}:Counter"


@pytest.mark.parametrize("text", ["", "Mine", ":Mine", "a.b:", "mine.py", "a.b:Mine.Inner", "a.b:1", "mine.py:x y"])
def test_agent_without_file_or_class_is_refused_with_the_format(text: str) -> None:
    assert refused(text) == f'expected "package.module:Class" or "file.py:Class", got {text!r}'


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("no.such.module:Mine", "does not import"),
        ("..up:Mine", "does not import"),
        ("swarmwire.agent.nothing:Mine", "does not import"),
        ("/a/folder:Mine", "does not import"),
        ("/nowhere/mine.py:Mine", "there is no file /nowhere/mine.py"),
    ],
)
def test_agent_module_or_file_that_is_missing_is_refused(text: str, reason: str) -> None:
    assert reason in refused(text)


@pytest.mark.parametrize(
    ("code", "reason"),
    [
        ("import no_such_module\n", "does not import: ModuleNotFoundError: No module named 'no_such_module'"),
        ("def broken(:\n", "does not import: SyntaxError"),
        ("\n1 / 0\n", "does not import: ZeroDivisionError: division by zero (line 3)"),
        ("open('weights.json')\n", "does not import: FileNotFoundError"),  # the agent's own file, not the agent
        ("class Yours(Agent): ...\n", "holds no such name: 'Mine'"),
        ("class Mein(Agent): ...\n", "holds no such name: 'Mine' (did you mean Mein?)"),
        ("Mine = 3\n", "holds no Agent or VectorAgent: 'Mine'"),
        ("class Mine: ...\n", "holds no Agent or VectorAgent: 'Mine'"),
        ("class Mine(Agent): ...\n", "Mine has no step method"),
        ("class Mine(Agent):\n    seen = {}\n    def step(self, robot): ...\n", "Mine.seen: a dict that all robots"),
        ("class Mine(VectorAgent): ...\n", "Mine has no step method"),
        ("class Mine(Agent):\n    api = 99\n    def step(self, robot): ...\n", "Mine.api: expected 1"),
        ("class Mine(Agent):\n    needs = 'compass'\n    def step(self, robot): ...\n", "expected a tuple of texts"),
        ("class Mine(Agent):\n    needs = ('a', 1)\n    def step(self, robot): ...\n", "expected a tuple of texts"),
        (
            "class Mine(Agent):\n    speeds: list[float]\n    def step(self, robot): ...\n",
            "Mine.speeds: a parameter is",
        ),
        ("class Mine(Agent):\n    x: 'Nowhere'\n    def step(self, robot): ...\n", "name 'Nowhere' is not defined"),
    ],
)
def test_agent_file_without_a_usable_class_is_refused_with_the_reason(tmp_path: Path, code: str, reason: str) -> None:
    assert reason in refused(written(tmp_path, code))


def test_agent_file_is_reloaded_after_an_edit_without_bytecode(tmp_path: Path) -> None:
    refused(written(tmp_path, "1 / 0\n"))
    first = load_agent(written(tmp_path, NUMBERED.format(1)))
    edited = load_agent(written(tmp_path, NUMBERED.format(2)))  # of the same size, within the same second
    assert (vars(first)["number"], vars(edited)["number"]) == (1, 2)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.py"]


def test_agent_file_cannot_import_its_siblings(tmp_path: Path) -> None:
    (tmp_path / "swarmwire_test_beside.py").write_text("")
    reason = refused(written(tmp_path, "import swarmwire_test_beside\n"))
    assert "No module named 'swarmwire_test_beside' (line 2); a file is loaded alone" in reason


@pytest.mark.parametrize("name", ["x" * 5000 + ".py", "é" * 300, "a\0b.py", "x" * 5000], ids=lambda name: name[:3])
def test_agent_file_with_an_impossible_name_is_refused(tmp_path: Path, name: str) -> None:
    refused(resolve(f"{name}:Mine", tmp_path))


def refused_declared(params: dict[str, Any], kind: type = Parametrised) -> BadParameter:
    with pytest.raises(BadParameter) as caught:
        checked_parameters(kind, params)
    return caught.value


def test_parameters_are_annotated_attributes() -> None:
    declared = parameters_of(Parametrised)
    types = {"speed_mps": float, "count": int, "eager": bool, "word": str}
    assert {name: parameter.type for name, parameter in declared.items()} == types
    assert (declared["speed_mps"].default, declared["count"].default) == (REQUIRED, 3)
    assert "needs" not in parameters_of(Flocking)
    quiet = type("Quiet", (Agent,), {"__annotations__": {"_memory": list[int]}, "step": lambda *_: None})
    assert not parameters_of(quiet)


def test_parameters_are_set_before_the_constructor_for_each_agent() -> None:
    full = {"speed_mps": 0.5, "count": 0, "eager": True, "word": ""}
    assert make_agent(Parametrised, full).seen == (0.5, 0, True, "")
    assert make_agent(Parametrised, {"speed_mps": 0.5}).seen == (0.5, 3, False, "hop")


def test_float_parameter_accepts_a_whole_number() -> None:
    value = checked_parameters(Parametrised, {"speed_mps": 2})["speed_mps"]
    assert type(value) is float
    assert value == 2.0


@pytest.mark.parametrize(
    ("key", "value"),
    [
        *(("speed_mps", value) for value in ("0.5", True, None, float("nan"), float("inf"), -(2**63) - 1)),
        *(("count", value) for value in (2.0, True, 2**63)),
        *(("eager", 1), ("word", 3), ("word", ["a"])),
    ],
)
def test_parameter_of_another_type_is_refused(key: str, value: Any) -> None:
    assert refused_declared({"speed_mps": 1.0, key: value}).key == key


def test_unknown_or_missing_parameter_is_refused_with_the_known_ones() -> None:
    error = refused_declared({"speed_mps": 1.0, "sped": 1})
    assert error.key == "sped"
    assert "expected one of speed_mps (did you mean this?), count, eager, word" in error.expected
    assert refused_declared({"x": 1}, Stateless).expected == "unknown parameter of Stateless; expected none"
    assert refused_declared({"speed_mps": 1.0, "needs": 1}).key == "needs"
    missing = refused_declared({})
    assert (missing.key, missing.expected) == ("speed_mps", "is missing: expected a number")


class Bounded(Agent):
    share: float = parameter(0.5, help="a share", at_least=0.0, at_most=1.0)
    side: str = parameter(help="where it turns", choices=("left", "right"))

    def step(self, robot: Robot) -> None: ...


class Narrower(Bounded):
    share: float = 0.25


@pytest.mark.parametrize("kind", [Bounded, Narrower])
@pytest.mark.parametrize(
    ("key", "value"), [("share", -0.1), ("share", 2), ("share", float("nan")), ("side", "up"), ("side", 1)]
)
def test_parameter_outside_its_bounds_is_refused_also_in_a_subclass(kind: type[Bounded], key: str, value: Any) -> None:
    assert refused_declared({"side": "left", key: value}, kind).key == key


def test_parameter_with_bounds_has_its_default_and_help() -> None:
    assert make_agent(Narrower, {"side": "left"}).share == 0.25
    assert make_agent(Bounded, {"side": "left", "share": 1}).share == 1.0
    assert [declared.bounds.help for declared in parameters_of(Narrower).values()] == ["a share", "where it turns"]
    assert refused_declared({}, Bounded).key == "side"


@pytest.mark.parametrize(
    ("base", "attributes", "name"),
    [
        (Bounded, {"__annotations__": {"share": float}, "share": 1.5}, "share"),  # outside the bounds of its base
        (Agent, {"turns": parameter(3, help="number of turns")}, "turns"),  # without a type
    ],
)
def test_parameter_declaration_that_is_contradictory_is_refused(base: type, attributes: Any, name: str) -> None:
    with pytest.raises(TypeError, match=name):
        parameters_of(type("Odd", (base,), attributes))


def test_subclass_inherits_parameters_with_its_own_defaults() -> None:
    class Slow(Parametrised):
        speed_mps: float = 0.1
        patience_s: float = 5.0

    assert list(parameters_of(Slow)) == ["speed_mps", "count", "eager", "word", "patience_s"]
    assert make_agent(Slow, {}).seen[0] == 0.1


@pytest.mark.parametrize(("name", "hint", "value"), [("api", int, 1), ("needs", tuple[str, ...], ("compass",))])
def test_class_declarations_are_no_parameters_with_any_annotation(name: str, hint: Any, value: Any) -> None:
    kind = type("Mine", (Agent,), {"__annotations__": {name: hint, "gain": float}, name: value, "gain": 0.5})
    assert list(parameters_of(kind)) == ["gain"]
    assert refused_declared({name: value}, kind).key == name


def tx_statuses(tick: int) -> TxStatuses:
    """What radios tell: of packets of this agent, and of some that an agent before it sent."""
    row = np.array([0, 1, 5, 6], np.int64)
    return TxStatuses(row, np.array([2 * tick, 0, tick, 1], np.int64), np.array([0, 1, 0, 2], np.int64))


def acting(tick: int) -> list[int]:
    """Robots that drop out and come back."""
    return [row for row in ROWS if (row + tick) % 4]


def act(executor: AgentExecutor, tick: int) -> Actions:
    return executor.act(tick, one_group(tick, acting(tick)), ReceivedPackets.none(MEASURES), tx_statuses(tick))


def ids(actions: Actions) -> list[int]:
    return [] if actions.sent.tx_status_id is None else actions.sent.tx_status_id.tolist()


def over_the_wire(executor: AgentExecutor, name: str) -> GroupMemories:
    layouts = {"flock": layout_of(load_agent(spec(name)))}
    return decode_memory(frames.decode(encode_memory(executor.memory(["flock"]))), layouts)


@pytest.mark.parametrize("name", ["VectorInsisting", "VectorCounter"])
@pytest.mark.parametrize("at", range(1, 7))
def test_memory_continues_on_another_executor(name: str, at: int) -> None:
    first = AgentExecutor(ASSIGNMENTS[name])
    for tick in range(at):
        act(first, tick)
    second = AgentExecutor(ASSIGNMENTS[name], over_the_wire(first, name))
    for tick in range(at, at + 6):
        got, expected = act(second, tick), act(first, tick)
        assert plain(got) == plain(expected)
        assert ids(got) == ids(expected)


def test_memory_of_some_robots_moves_and_the_others_start_anew() -> None:
    first = AgentExecutor(ASSIGNMENTS["VectorCounter"])
    for tick in range(4):
        first.act(tick, one_group(tick, ROWS), ReceivedPackets.none(MEASURES))
    memories = {"flock": first.memory(["flock"])["flock"].for_rows(np.array([1, 5]))}
    second = AgentExecutor(ASSIGNMENTS["VectorCounter"], memories)
    got = second.act(4, one_group(4, ROWS), ReceivedPackets.none(MEASURES))
    assert (got.rows.tolist(), got.linear_mps.tolist()) == (ROWS, [1.0, 5.0, 1.0, 5.0, 1.0])


def test_memory_of_a_robot_that_did_not_act_last_is_dropped() -> None:
    first = AgentExecutor(ASSIGNMENTS["VectorCounter"])
    first.act(0, one_group(0, ROWS), ReceivedPackets.none(MEASURES))
    first.act(1, one_group(1, [0, 1]), ReceivedPackets.none(MEASURES))
    got = AgentExecutor(ASSIGNMENTS["VectorCounter"], first.memory(["flock"])).act(
        2, one_group(2, [1, 2]), ReceivedPackets.none(MEASURES)
    )
    assert got.linear_mps.tolist() == [3.0, 1.0]


def test_memory_of_a_one_robot_agent_is_dropped() -> None:
    first = AgentExecutor(ASSIGNMENTS["Counter"])
    for tick in range(4):
        first.act(tick, one_group(tick, ROWS), ReceivedPackets.none(MEASURES))
    second = AgentExecutor(ASSIGNMENTS["Counter"], over_the_wire(first, "Counter"))
    assert second.act(4, one_group(4, ROWS), ReceivedPackets.none(MEASURES)).linear_mps.tolist() == [1.0] * len(ROWS)


def test_memory_of_parts_is_joined_in_the_order_of_the_robots() -> None:
    undivided = GroupMemory(np.arange(6), {"x": np.arange(6) * 0.5, "y": np.arange(12).reshape(6, 2)})
    joined = GroupMemory.joined([undivided.for_rows(np.array(rows)) for rows in ([1, 3, 5], [0, 2], [4])])
    assert joined.rows.tolist() == undivided.rows.tolist()
    assert all(np.array_equal(joined.columns[name], column) for name, column in undivided.columns.items())


@pytest.mark.parametrize(
    "changed",
    [
        {"memory/g/x": None},
        {"memory/g/x": np.array([0.5])},
        {"memory/g/x": np.array([1, 2])},
        {"memory/g/y": np.array([1, 2])},
        {"memory/g/y": np.array([[1], [2]])},
        {"memory/g/rows": np.array([3, 1])},
        {"memory/g/rows": np.array([1, 2])},
        {"memory/g/rows": np.array([1.0, 3.0])},
    ],
    ids=repr,
)
def test_memory_of_another_shape_is_refused(changed: dict[str, Any]) -> None:
    arrays = {name: array for name, array in {**SOUND, **changed}.items() if array is not None}
    with pytest.raises(BadFrame):
        decode_memory(frames.decode(frames.encode("memory", -1, arrays)), LAYOUT, {"g": np.array([1, 3])})


def test_memory_frame_has_no_tick_and_only_its_robots_and_groups() -> None:
    memories = {"g": GroupMemory(np.array([1, 3]), {"x": SOUND["memory/g/x"], "y": SOUND["memory/g/y"]})}
    frame = frames.decode(encode_memory(memories))
    assert (frame.kind, frame.tick) == ("memory", -1)
    got = decode_memory(frame, {"without": LAYOUT["g"], **LAYOUT}, {"g": np.array([1, 3])})
    assert (list(got), got["g"].columns["y"].tolist()) == (["g"], [[1, 2], [3, 4]])
    assert decode_memory(frame, {"other": LAYOUT["g"]}) == {}
    assert decode_memory(frame, LAYOUT)["g"].rows.tolist() == [1, 3]
    for group_name, rows in (("g", [1]), ("g", [1, 5]), ("other", [1, 3])):
        with pytest.raises(BadFrame, match="expected the runner's own robots"):
            decode_memory(frame, LAYOUT, {group_name: np.array(rows)})

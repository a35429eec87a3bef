"""The steps of a tick, read from the source of the loop, so that the drawing cannot differ from the code."""

import ast
import inspect
import textwrap
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from swarmwire.world.loop import Loop

LANES: tuple[str, ...] = ("events", "medium", "world", "mailbox", "backend", "observer")


@dataclass(frozen=True)
class Step:
    """A call in a tick: the lane of its object, its method, and its arguments from other lanes as (name, lane)."""

    lane: str
    method: str
    takes: tuple[tuple[str, str], ...]


def tick_steps() -> list[Step]:
    """The calls of a tick to those who take part in it, in their order."""
    givers: dict[str, str] = {}
    return [*_steps(Loop.begin_tick, givers), *_steps(Loop.end_tick, givers)]


def _steps(method: Callable[..., object], givers: dict[str, str]) -> Iterator[Step]:
    """The calls of a method of the loop; `givers` has, of each local name so far, the lane that it came from.

    The loop's own methods whose result it keeps stand for what is in them, and their names for the same things.
    """
    body = ast.parse(textwrap.dedent(inspect.getsource(method)))
    statements = [node for node in ast.walk(body) if isinstance(node, ast.Assign | ast.Expr)]
    for statement in sorted(statements, key=lambda node: node.lineno):
        called = _own_method(statement.value) if isinstance(statement, ast.Assign) else None
        if called is not None:
            yield from _steps(called, givers)
            continue
        yield from (_step(call, givers) for call in _calls(statement.value))
        if isinstance(statement, ast.Assign):
            givers |= _inputs(statement.targets[0], statement.value, givers)


def _inputs(target: ast.expr, value: ast.expr, givers: dict[str, str]) -> dict[str, str]:
    """Of each name that is assigned to, the lane that it came from."""
    if isinstance(value, ast.Name) and value.id == "inputs":
        return {}  # what the first part of a tick hands to the second keeps its names
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
        pairs = zip(target.elts, value.elts, strict=True)
        return {name: lane for each in pairs for name, lane in _inputs(*each, givers).items()}
    names = [node.id for node in ast.walk(target) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)]
    return dict.fromkeys(names, _giver(value, givers))


def _own_method(value: ast.expr) -> Callable[..., object] | None:
    """The method of the loop that a value is a call of; None if it is none."""
    if isinstance(value, ast.Call) and isinstance(value.func, ast.Attribute):
        owner = value.func.value
        if (
            isinstance(owner, ast.Name)
            and owner.id == "self"
            and inspect.isfunction(getattr(Loop, value.func.attr, None))
        ):
            return getattr(Loop, value.func.attr)
    return None


def _calls(value: ast.expr) -> Iterator[ast.Call]:
    return (node for node in ast.walk(value) if isinstance(node, ast.Call) and _lane(node.func))


def _step(call: ast.Call, givers: dict[str, str]) -> Step:
    lane = _lane(call.func)
    nodes = [node for argument in call.args for node in ast.walk(argument)]
    names = [(node.id, givers.get(node.id, lane)) for node in nodes if isinstance(node, ast.Name)]
    names += [(node.attr, _lane(node)) for node in nodes if isinstance(node, ast.Attribute)]  # such as `world.pose`
    takes = {name: giver for name, giver in names if giver not in {"", lane}}
    return Step(lane, ast.unparse(call.func).rpartition(".")[2], tuple(takes.items()))


def _giver(value: ast.expr, givers: dict[str, str]) -> str:
    """The lane whose call, attribute or earlier gift a value is; empty where it is of the loop's own making."""
    if isinstance(value, ast.Call) and not _lane(value.func):
        return _lane(value.func.value) if isinstance(value.func, ast.Attribute) else ""  # a copy of an array, or none's
    for node in ast.walk(value):
        if isinstance(node, ast.Attribute) and _lane(node):
            return _lane(node)
        if isinstance(node, ast.Name) and givers.get(node.id):
            return givers[node.id]
    return ""


def _lane(node: ast.expr) -> str:
    """The lane that `self.medium.x`, `self._events.x` or `world.x` belongs to; empty if there is none."""
    if not isinstance(node, ast.Attribute) or not isinstance(node.value, ast.Attribute | ast.Name):
        return ""
    owner = node.value.attr if isinstance(node.value, ast.Attribute) else node.value.id
    return owner.removeprefix("_") if owner.removeprefix("_") in LANES else ""

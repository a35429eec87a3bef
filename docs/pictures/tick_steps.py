"""The steps of a tick, read from the source of the loop, so that what is drawn of it is what it does."""

import ast
import inspect
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass

from swarmwire.world.loop import Loop

LANES: tuple[str, ...] = ("events", "air", "world", "mailbox", "crew", "observer")


@dataclass(frozen=True)
class Step:
    """A call in a tick: whose method, and what it takes that others gave, as (name, lane that gave it)."""

    lane: str
    method: str
    takes: tuple[tuple[str, str], ...]


def tick_steps() -> list[Step]:
    """The calls of a tick to those who take part in it, in their order."""
    body = ast.parse(textwrap.dedent(inspect.getsource(Loop.step)))
    statements = [node for node in ast.walk(body) if isinstance(node, ast.Assign | ast.Expr)]
    givers: dict[str, str] = {}  # of each local name: the lane that it came from
    steps: list[Step] = []
    for statement in sorted(statements, key=lambda node: node.lineno):
        steps += [_step(call, givers) for call in _calls(statement.value)]
        if isinstance(statement, ast.Assign):
            targets = [node.id for node in ast.walk(statement.targets[0]) if isinstance(node, ast.Name)]
            givers |= dict.fromkeys(targets, _giver(statement.value, givers))
    return steps


def _calls(value: ast.expr) -> Iterator[ast.Call]:
    return (node for node in ast.walk(value) if isinstance(node, ast.Call) and _lane(node.func))


def _step(call: ast.Call, givers: dict[str, str]) -> Step:
    lane = _lane(call.func)
    names = [node.id for given in call.args for node in ast.walk(given) if isinstance(node, ast.Name)]
    takes = {name: givers[name] for name in names if givers.get(name, lane) not in {"", lane}}
    return Step(lane, ast.unparse(call.func).rpartition(".")[2], tuple(takes.items()))


def _giver(value: ast.expr, givers: dict[str, str]) -> str:
    """The lane whose call, attribute or earlier gift a value is; empty where it is of the loop's own making."""
    if isinstance(value, ast.Call) and not _lane(value.func):
        return ""
    for node in ast.walk(value):
        if isinstance(node, ast.Attribute) and _lane(node):
            return _lane(node)
        if isinstance(node, ast.Name) and givers.get(node.id):
            return givers[node.id]
    return ""


def _lane(node: ast.expr) -> str:
    """Whose attribute `self.air.x`, `self._events.x` or `world.x` is; empty where it is nobody's of the tick."""
    if not isinstance(node, ast.Attribute) or not isinstance(node.value, ast.Attribute | ast.Name):
        return ""
    whose = node.value.attr if isinstance(node.value, ast.Attribute) else node.value.id
    return whose.removeprefix("_") if whose.removeprefix("_") in LANES else ""

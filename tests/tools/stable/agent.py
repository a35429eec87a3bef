"""What agents are written against: every class and function for them, with its signatures."""

import ast
from importlib import import_module
from typing import Any

from tests.tools.stable.sources import Name, described_in, made_in, modules, names_of, tree_of

PAGE = "agent.md"
SPOKEN = ("__call__", "__getitem__", "__iter__", "__len__")  # methods that users call by other signs


def text() -> str:
    """A class or function a paragraph, in the order of its name; what it is made of a line each."""
    return "\n".join(_told(name, left_out) for name, left_out in sorted(described_in(PAGE).items()))


def _told(name: Name, left_out: frozenset[str]) -> str:
    module, inner = made_in(name)
    node = next(node for node in tree_of(modules()[module]).body if inner in names_of(node))
    head = f"{'.'.join(name)}\n"
    if isinstance(node, ast.FunctionDef):
        return f"{head}    {_signature(node)}\n"
    if not isinstance(node, ast.ClassDef):
        return f"{head}    {ast.unparse(node)}\n"
    members: dict[str, str] = {}
    for base in reversed(getattr(import_module(module), inner).__mro__):
        if base.__module__ in modules():
            members |= _members(base)
    return head + "".join(f"    {line}\n" for member, line in members.items() if member not in left_out)


def _members(kind: type[Any]) -> dict[str, str]:
    tree = tree_of(modules()[kind.__module__])
    node = next(node for node in tree.body if isinstance(node, ast.ClassDef) and node.name == kind.__name__)
    return {name: line for item in node.body for name, line in _member(item)}


def _member(item: ast.stmt) -> list[tuple[str, str]]:
    if isinstance(item, ast.FunctionDef) and item.name == "__init__":
        return [(name, name) for name in _kept(item)]
    if isinstance(item, ast.FunctionDef):
        shown = not item.name.startswith("_") or item.name in SPOKEN
        return [(item.name, _signature(item))] if shown else []
    return [(name, ast.unparse(item)) for name in names_of(item) if not name.startswith("_")]


def _kept(init: ast.FunctionDef) -> list[str]:
    """The public attributes that it sets."""
    stored = (node for node in ast.walk(init) if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store))
    return [node.attr for node in stored if not node.attr.startswith("_")]


def _signature(node: ast.FunctionDef) -> str:
    marks = {ast.unparse(mark) for mark in node.decorator_list}
    returns = ast.unparse(node.returns) if node.returns else "None"
    if marks & {"property", "cached_property"}:
        return f"{node.name}: {returns}"
    kind = "".join(f"@{mark} " for mark in sorted(marks & {"classmethod", "staticmethod"}))
    return f"{kind}{node.name}({ast.unparse(node.args)}) -> {returns}"

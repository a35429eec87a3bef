"""The classes and functions that agents are written against, with their signatures, as docs/api describes them."""

import ast
import re
from functools import cache
from importlib import import_module
from inspect import isclass, isfunction
from pathlib import Path
from types import ModuleType
from typing import Any

PAGE = "agent.md"
SPOKEN = ("__call__", "__getitem__", "__iter__", "__len__")  # methods that users call by other signs
ROOT = Path(__file__).parents[3]
PARTS = ("comms", "agent", "world", "metrics", "deploy")
TEMPLATE = "swarm_template"  # files for users, which `swarmwire new` copies
DIRECTIVE = r"(?:auto|py:)(?P<kind>class|data|function|module|type)"
DOCUMENTED = re.compile(DIRECTIVE + r":: (?P<path>[\w.]+)(?P<options>(?:\n   :.*)*)")
Name = tuple[str, str]  # module, and name within it


def text() -> str:
    """A class or function a paragraph, in the order of its name; what it is made of a line each."""
    return "\n".join(_description(name, left_out) for name, left_out in sorted(described_in(PAGE).items()))


def _description(name: Name, left_out: frozenset[str]) -> str:
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
        return [(name, name) for name in _attributes(item)]
    if isinstance(item, ast.FunctionDef):
        shown = not item.name.startswith("_") or item.name in SPOKEN
        return [(item.name, _signature(item))] if shown else []
    return [(name, ast.unparse(item)) for name in names_of(item) if not name.startswith("_")]


def _attributes(init: ast.FunctionDef) -> list[str]:
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


@cache
def modules() -> dict[str, Path]:
    """The file of every module of the five parts."""
    paths: dict[str, Path] = {}
    for part in PARTS:
        for path in sorted((ROOT / part / "swarmwire").rglob("*.py")):
            if TEMPLATE not in path.parts:
                inner = path.relative_to(ROOT / part).with_suffix("")
                paths[".".join(inner.parts).removesuffix(".__init__")] = path
    return paths


@cache
def tree_of(path: Path) -> ast.Module:
    """The syntax tree of a file."""
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def made_in(name: Name) -> Name:
    """Where a name that other modules import and export again is defined."""
    module, inner = name
    source = _imported(tree_of(modules()[module])).get(inner)
    return made_in(source) if source and source[0] in modules() else name


def names_of(node: ast.stmt) -> list[str]:
    """The names that a statement gives to functions, classes and values."""
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        return [node.name]
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else ()
    return [inner.id for target in targets for inner in ast.walk(target) if isinstance(inner, ast.Name)]


def described_in(page: str) -> dict[Name, frozenset[str]]:
    """The names that a page of docs/api describes, and which of their members it leaves out."""
    entries: dict[Name, frozenset[str]] = {}
    for match in DOCUMENTED.finditer((ROOT / "docs" / "api" / page).read_text(encoding="utf-8")):
        module, _, name = match["path"].rpartition(".")
        left_out = re.search(r":exclude-members: (.*)", match["options"])
        names = {(module, name)}
        if match["kind"] == "module":
            names = _public_names(match["path"])
        entries |= dict.fromkeys(names, frozenset(left_out[1].split(", ") if left_out else ()))
    return entries


def _public_names(path: str) -> set[Name]:
    module = import_module(path)
    names: list[str] = getattr(module, "__all__", [])
    return {(path, name) for name in names or vars(module) if names or _is_public(module, name)}


def _is_public(module: ModuleType, name: str) -> bool:
    """Whether this is a public class or function of a module without `__all__`."""
    value = getattr(module, name)
    return not name.startswith("_") and (isclass(value) or isfunction(value)) and value.__module__ == module.__name__


def _imported(tree: ast.Module) -> dict[str, Name]:
    """The names that a file imports from our modules, and the module and name that each stands for."""
    return {
        alias.asname or alias.name: (node.module, alias.name)
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "swarmwire"
        for alias in node.names
    }

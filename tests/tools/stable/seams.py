"""What crosses a seam: the names that users rely on, and those that one part takes from another."""

import re
from collections import defaultdict
from functools import cache
from importlib import import_module
from inspect import isclass, isfunction
from types import ModuleType

from tests.tools.stable.sources import PARTS, ROOT, TEMPLATE, Name, modules, part_of, taken_by, tree_of

FOR_USERS = ("agent", "agent.behaviours", "agent.readings", "agent.testing", "deploy", "world.own")
DIRECTIVE = r"(?:auto|py:)(?P<kind>class|data|function|module|type)"
DOCUMENTED = re.compile(DIRECTIVE + r":: (?P<path>[\w.]+)(?P<options>(?:\n   :.*)*)")
USERS = "users"


@cache
def seams() -> dict[Name, list[str]]:
    """Who relies on each public name: "users", and the parts that take it from another, in the order of the parts."""
    found: dict[Name, set[str]] = defaultdict(set)
    for name in given_to_users():
        found[name].add(USERS)
    for module, path in modules().items():
        for name in taken_by(tree_of(path)):
            if part_of(name[0]) != part_of(module):
                found[name].add(part_of(module))
    order = [USERS, *PARTS]
    ranked = sorted(found, key=lambda name: (PARTS.index(part_of(name[0])), name))
    return {name: sorted(found[name], key=order.index) for name in ranked}


def given_to_users() -> set[Name]:
    """Whatever the packages for users hold, the reference in docs/api describes, or examples for users take."""
    found = {name for short in FOR_USERS for name in _held_by(f"swarmwire.{short}")}
    for page in (ROOT / "docs" / "api").glob("*.md"):
        found |= described_in(page.name).keys()
    for folder in (ROOT / "examples", *(ROOT / "deploy").rglob(TEMPLATE)):
        for path in folder.rglob("*.py"):
            found |= taken_by(tree_of(path))
    return found


def described_in(page: str) -> dict[Name, frozenset[str]]:
    """The names that a page of docs/api describes, and which of their members it leaves out."""
    found: dict[Name, frozenset[str]] = {}
    for match in DOCUMENTED.finditer((ROOT / "docs" / "api" / page).read_text(encoding="utf-8")):
        module, _, name = match["path"].rpartition(".")
        left_out = re.search(r":exclude-members: (.*)", match["options"])
        names = {(module, name)}
        if match["kind"] == "module":
            names = _held_by(match["path"], handed_on=":imported-members:" in match["options"])
        found |= dict.fromkeys(names, frozenset(left_out[1].split(", ") if left_out else ()))
    return found


def text() -> str:
    """The list that is kept: a name and who relies on it, a line each."""
    return "".join(f"{module} {name}: {', '.join(users)}\n" for (module, name), users in seams().items())


def _held_by(path: str, handed_on: bool = False) -> set[Name]:
    module = import_module(path)
    names: list[str] = getattr(module, "__all__", [])
    return {(path, name) for name in names or vars(module) if names or _is_public(module, name, handed_on)}


def _is_public(module: ModuleType, name: str, handed_on: bool) -> bool:
    """Whether a module without `__all__` gives this class or function."""
    of = getattr(module, name)
    ours = f"{of.__module__}." if isclass(of) or isfunction(of) else ""
    return not name.startswith("_") and ours.startswith("swarmwire." if handed_on else f"{module.__name__}.")

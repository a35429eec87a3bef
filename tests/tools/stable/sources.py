"""The five parts' code as a reader of the reference sees it: what a page of it describes, and where that is defined."""

import ast
import re
from functools import cache
from importlib import import_module
from inspect import isclass, isfunction
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).parents[3]
PARTS = ("comms", "agent", "world", "metrics", "deploy")
TEMPLATE = "swarm_template"  # files for users, which `swarmwire new` copies
DIRECTIVE = r"(?:auto|py:)(?P<kind>class|data|function|module|type)"
DOCUMENTED = re.compile(DIRECTIVE + r":: (?P<path>[\w.]+)(?P<options>(?:\n   :.*)*)")
Name = tuple[str, str]  # module, and name within it


@cache
def modules() -> dict[str, Path]:
    """The file of every module of the five parts."""
    found: dict[str, Path] = {}
    for part in PARTS:
        for path in sorted((ROOT / part / "swarmwire").rglob("*.py")):
            if TEMPLATE not in path.parts:
                inner = path.relative_to(ROOT / part).with_suffix("")
                found[".".join(inner.parts).removesuffix(".__init__")] = path
    return found


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
    found: dict[Name, frozenset[str]] = {}
    for match in DOCUMENTED.finditer((ROOT / "docs" / "api" / page).read_text(encoding="utf-8")):
        module, _, name = match["path"].rpartition(".")
        left_out = re.search(r":exclude-members: (.*)", match["options"])
        names = {(module, name)}
        if match["kind"] == "module":
            names = _public_names(match["path"], exported_again=":imported-members:" in match["options"])
        found |= dict.fromkeys(names, frozenset(left_out[1].split(", ") if left_out else ()))
    return found


def _public_names(path: str, exported_again: bool) -> set[Name]:
    module = import_module(path)
    names: list[str] = getattr(module, "__all__", [])
    return {(path, name) for name in names or vars(module) if names or _is_public(module, name, exported_again)}


def _is_public(module: ModuleType, name: str, exported_again: bool) -> bool:
    """Whether this is a public class or function of a module without `__all__`."""
    value = getattr(module, name)
    defined = f"{value.__module__}." if isclass(value) or isfunction(value) else ""
    prefix = "swarmwire." if exported_again else f"{module.__name__}."
    return not name.startswith("_") and defined.startswith(prefix)


def _imported(tree: ast.Module) -> dict[str, Name]:
    """The names that a file imports from our modules, and the module and name that each stands for."""
    return {
        alias.asname or alias.name: (node.module, alias.name)
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "swarmwire"
        for alias in node.names
    }

"""The five parts' code as a reader sees it: which names a file takes, where these are made, and of what."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[3]
PARTS = ("comms", "agent", "world", "metrics", "deploy")
TEMPLATE = "swarm_template"  # files for users, which `swarmwire new` copies
COMMENT = re.compile(r"  # (?!noqa|pyright)(.*)")
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


def part_of(module: str) -> str:
    """The part that a module belongs to."""
    return module.split(".")[1]


@cache
def tree_of(path: Path) -> ast.Module:
    """The syntax tree of a file."""
    return ast.parse(path.read_text(encoding="utf-8"))


def taken_by(tree: ast.Module) -> set[Name]:
    """The names that a file imports from modules of ours, and those that it reaches through a module."""
    known = _known(tree)
    taken = {*known.values(), *_mentioned(tree, known)}
    return {name for name in taken if not _is_module(name) and not name[1].startswith("__")}


@cache
def made_in(name: Name) -> Name:
    """Where a name that other modules hand on is made."""
    module, inner = name
    source = _known(tree_of(modules()[module])).get(inner)
    return made_in(source) if source and source[0] in modules() else name


@cache
def made_of() -> dict[Name, set[Name]]:
    """What each function, class and value of ours mentions, its types and a class's bases too, by where it is made."""
    found: dict[Name, set[Name]] = {}
    bases: dict[Name, set[Name]] = {}
    for module, path in modules().items():
        tree = tree_of(path)
        own = {name: (module, name) for node in tree.body for name in names_of(node)}
        known = {**own, **_known(tree)}
        for node in tree.body:
            mentioned = {made_in(name) for name in _mentioned(node, known) if name[0] in modules()}
            found |= {(module, name): mentioned for name in names_of(node)}
            if isinstance(node, ast.ClassDef):
                bases[module, node.name] = {made_in(name) for base in node.bases for name in _mentioned(base, known)}
    return {name: mentioned.union(*_of_bases(name, bases, found)) for name, mentioned in found.items()}


def _of_bases(name: Name, bases: dict[Name, set[Name]], found: dict[Name, set[Name]]) -> Iterator[set[Name]]:
    """What the classes that a class is made of mention."""
    for base in bases.get(name, ()):
        yield found.get(base, set())
        yield from _of_bases(base, bases, found)


def said_of(name: Name) -> str:
    """The first line of its docstring; of what has none, the comment behind it, or above it or its neighbours."""
    module, inner = made_in(name)
    path = modules()[module]
    lines = path.read_text(encoding="utf-8").splitlines()
    for node in tree_of(path).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name == inner:
            return (ast.get_docstring(node) or "").partition("\n")[0]
        if inner in names_of(node):
            behind = COMMENT.search(lines[(node.end_lineno or node.lineno) - 1])
            return behind[1] if behind else _said_above(lines, node.lineno - 1)
    return ""


def _said_above(lines: list[str], row: int) -> str:
    while row > 0 and lines[row - 1].strip() and not lines[row - 1].startswith("#"):
        row -= 1
    last = row
    while row > 0 and lines[row - 1].startswith("#"):
        row -= 1
    return " ".join(line.lstrip("#: ") for line in lines[row:last])


def names_of(node: ast.stmt) -> list[str]:
    """The names that a statement gives to functions, classes and values."""
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        return [node.name]
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else ()
    return [inner.id for target in targets for inner in ast.walk(target) if isinstance(inner, ast.Name)]


def _is_module(name: Name) -> bool:
    """Whether this is a module, and nothing of the same name that its package hands on."""
    package = modules().get(name[0])
    return ".".join(name) in modules() and (package is None or name[1] not in _known(tree_of(package)))


@cache
def _known(tree: ast.Module) -> dict[str, Name]:
    """Names as a file knows them by its imports, and the modules of ours and the names there that they stand for."""
    return {
        alias.asname or alias.name: (node.module, alias.name)
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "swarmwire"
        for alias in node.names
    }


def _mentioned(tree: ast.AST, known: dict[str, Name]) -> Iterator[Name]:
    """The names of ours that stand in this piece of code, quoted types too, by what the file knows."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and node.id in known:
            yield known[node.id]
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            module = ".".join(known.get(node.value.id, ()))
            if module in modules():
                yield module, node.attr

"""Docstrings, and comments behind attributes, as texts. Light to import: the command line's help uses it."""

import ast
import inspect
import io
import textwrap
import tokenize
from collections.abc import Collection
from functools import cache
from typing import Any


def flowing(text: str | None) -> str:
    r"""A docstring with the lines of each paragraph joined; formulas, tables and lists keep their lines.

    >>> flowing("One\nline.\n\n  as it\n  stands")
    'One line.\n\n  as it\n  stands'
    """
    return "\n\n".join(map(_joined, inspect.cleandoc(text or "").split("\n\n")))


def _joined(paragraph: str) -> str:
    lines = paragraph.split("\n")
    kept = any(line.startswith((" ", "- ", "* ", "\b")) for line in lines)
    return paragraph if kept else " ".join(lines)


def first_line(docstring: str | None) -> str:
    """The first paragraph of a docstring as one line, without the full stop at its end."""
    return flowing(docstring).partition("\n\n")[0].strip().removesuffix(".")


def texts_of(kind: type, bases: tuple[Any, ...]) -> str:
    """The docstrings of a class and of what it inherits from, without those of `bases`."""
    of = [base for base in kind.__mro__ if base not in bases]
    return "\n\n".join(flowing(base.__dict__["__doc__"]) for base in of if base.__dict__.get("__doc__"))


def comments_of(kind: type, names: Collection[str]) -> dict[str, str]:
    """By attribute: the comment behind it in the class's body or a base's; none where there is no source to read.

    Only classes that declare one of `names` are read, which takes milliseconds for each.
    """
    found: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        if not {*base.__dict__, *inspect.get_annotations(base)} & set(names):
            continue
        found |= _comments_in(base)
    return found


@cache
def _comments_in(kind: type) -> dict[str, str]:
    """By attribute that the body of this class declares: the comment behind it; none without readable source."""
    try:
        source = textwrap.dedent(inspect.getsource(kind))
    except (OSError, TypeError):  # typed in, or compiled
        return {}
    comments = _comments_by_line(source)
    return {name: comments[line] for line, name in _attributes(source) if line in comments}


def _attributes(source: str) -> list[tuple[int, str]]:
    """The last line and the name of every attribute that a class's body assigns or annotates."""
    tree = ast.parse(source).body[0]
    statements = tree.body if isinstance(tree, ast.ClassDef) else []
    annotated = [(of.end_lineno or 0, of.target) for of in statements if isinstance(of, ast.AnnAssign)]
    assigned = [(of.end_lineno or 0, of.targets[0]) for of in statements if isinstance(of, ast.Assign)]
    return [(line, target.id) for line, target in annotated + assigned if isinstance(target, ast.Name)]


def _comments_by_line(source: str) -> dict[int, str]:
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    return {of.start[0]: of.string.lstrip("#: ").strip() for of in tokens if of.type == tokenize.COMMENT}

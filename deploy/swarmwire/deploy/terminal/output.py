"""Plain texts for people: docstrings that flow, and printed lines. Light to import: the command line's help uses it.

Names and messages come from files and other machines, so every printed text is made printable.
"""

import inspect
from typing import Any

import typer

from swarmwire.comms.base.printable import LINES, printable


def echo(text: str, *, err: bool = False, nl: bool = True) -> None:
    """Print one or several lines to stdout or stderr; `nl` ends the last line."""
    typer.echo(printable(text, keep=LINES), err=err, nl=nl)  # noqa: TID251 - the only call


def flowing(text: str | None) -> str:
    r"""Join the lines of each paragraph of a docstring; formulas, tables and lists keep their lines.

    >>> flowing("One\nline.\n\n  as it\n  stands")
    'One line.\n\n  as it\n  stands'
    """
    return "\n\n".join(map(_joined, inspect.cleandoc(text or "").split("\n\n")))


def _joined(paragraph: str) -> str:
    lines = paragraph.split("\n")
    is_formatted = any(line.startswith((" ", "- ", "* ", "\b")) for line in lines)
    return paragraph if is_formatted else " ".join(lines)


def first_line(docstring: str | None) -> str:
    """Return the first paragraph of a docstring as one line, without its final full stop."""
    return flowing(docstring).partition("\n\n")[0].strip().removesuffix(".")


def texts_of(kind: type, bases: tuple[Any, ...]) -> str:
    """Return the docstrings of a class and its base classes, without those of `bases`."""
    kinds = [base for base in kind.__mro__ if base not in bases]
    return "\n\n".join(flowing(base.__dict__["__doc__"]) for base in kinds if base.__dict__.get("__doc__"))

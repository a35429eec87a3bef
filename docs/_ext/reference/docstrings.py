"""Docstrings for the reference: those of a class and its bases as one text, and Google's sections for autodoc."""

import re
from inspect import cleandoc
from typing import Any

from sphinx.application import Sphinx
from sphinx.ext.napoleon.docstring import GoogleDocstring

from reference.field_comments import SILENT, help_of

MARKUP = re.compile(r"[|*]|(?<=\w)_(?!\w)")  # |a|, *args, name_


def told_of(kind: type[Any], below: type[Any]) -> str:
    """The docstrings of the bases that lie below the class `below`, from the most general on, and of `kind` last."""
    ours = [base for base in kind.__mro__ if issubclass(base, below) and base is not below]
    return "\n\n".join(cleandoc(base.__doc__) for base in reversed(ours) if base.__doc__)


def prepare(_app: Sphinx, what: str, name: str, _of: Any, _options: Any, lines: list[str]) -> None:
    """Make reStructuredText of a docstring, in place.

    A module's is for its maintainers: the page says what it is about. Napoleon as it stands would take "value: what it
    means" in a property's docstring for a type and a meaning; ours are sentences.
    """
    if what == "module":
        lines.clear()
    elif lines and lines[0] == SILENT:
        lines[0] = _escaped(help_of(name)) or SILENT
    elif lines:
        lines[:] = GoogleDocstring([_escaped(line) for line in lines], what="method").lines()


def _escaped(line: str) -> str:
    """The line with what Markdown takes for text, and reStructuredText for markup, kept as text; code is left alone."""
    parts = line.split("`")
    return "`".join(MARKUP.sub(r"\\\g<0>", part) if i % 2 == 0 else part for i, part in enumerate(parts))

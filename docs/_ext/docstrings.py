"""A Sphinx extension: autodoc reads docstrings in Markdown, the help of parameters, and short names of array types."""

import re
import sys
from dataclasses import fields, is_dataclass
from typing import Any

from sphinx.addnodes import desc_signature
from sphinx.application import Sphinx
from sphinx.domains.python import PyAttribute, PyFunction, PyMethod, PyProperty
from sphinx.domains.python._object import PyObject
from sphinx.ext.napoleon.docstring import GoogleDocstring
from sphinx.util.typing import ExtensionMetadata

from swarmwire.comms.base.config import bounds_of

MARKUP = re.compile(r"[|*]|(?<=\w)_(?!\w)")  # |a|, *args, name_
NAMES = {"float64": "FloatArray", "int64": "IntArray", "bool": "BoolArray", "uint64": "KeyArray", "uint8": "ByteArray"}
ARRAY = re.compile(r"~?numpy\.ndarray\[tuple\[~?typing\.Any, \.\.\.\], ~?numpy\.dtype\[~?numpy\.(\w+)\]\]")
ARRAY_LIKE = re.compile(r"~?numpy\._typing\._array_like\._Buffer \| .*?_NestedSequence\[complex \| bytes \| str\]")


def setup(app: Sphinx) -> ExtensionMetadata:
    """Let autodoc read docstrings as this project writes them, and shorten the types of arrays."""
    app.setup_extension("sphinx.ext.autodoc")
    app.connect("autodoc-process-docstring", _prepare)
    kinds: dict[str, Any] = {"attribute": _Attribute, "function": _Function, "method": _Method, "property": _Property}
    for name, kind in kinds.items():
        app.add_directive_to_domain("py", name, kind, override=True)
    return {"version": "1", "parallel_read_safe": True}


def _prepare(_app: Sphinx, object_type: str, name: str, _object: Any, _options: Any, lines: list[str]) -> None:
    """Convert a docstring to reStructuredText, in place.

    The docstring of a module is for maintainers; the page introduces the module. A field without a comment gets the
    help of its `parameter`. Napoleon alone would take "value: what it means" in a property's docstring for a type and a
    meaning; the docstrings here are sentences.
    """
    if object_type == "module":
        lines.clear()
    elif lines and any(lines):
        lines[:] = GoogleDocstring([_escaped(line) for line in lines], what="method").lines()
    elif object_type == "attribute":
        lines[:] = [_escaped(_help_of(name))]


def _escaped(line: str) -> str:
    """Return the line with characters that only reStructuredText takes for markup escaped, except in code."""
    parts = line.split("`")
    return "`".join(MARKUP.sub(r"\\\g<0>", part) if i % 2 == 0 else part for i, part in enumerate(parts))


def _help_of(path: str) -> str:
    """Help and unit that `parameter` declares for the field with this full name; "" for none."""
    class_path, _, field_name = path.rpartition(".")
    module, _, class_name = class_path.rpartition(".")
    owner = getattr(sys.modules.get(module), class_name, None)
    bounds = [bounds_of(field) for field in fields(owner) if field.name == field_name] if is_dataclass(owner) else []
    return "".join(f"{each.help}, in {each.unit}" if each.unit else each.help for each in bounds)


def shortened(signature: str) -> str:
    """Return the signature with the names of `swarmwire.comms.base.arrays` for array types."""
    named = ARRAY.sub(lambda match: f"~swarmwire.comms.base.arrays.{NAMES[match[1]]}", signature)
    return ARRAY_LIKE.sub("~numpy.typing.ArrayLike", named)


class _Shortened(PyObject):
    def handle_signature(self, sig: str, signode: desc_signature) -> tuple[str, str]:
        if "type" in self.options:
            self.options["type"] = shortened(self.options["type"])
        return super().handle_signature(shortened(sig), signode)


class _Attribute(_Shortened, PyAttribute):
    pass


class _Function(_Shortened, PyFunction):
    pass


class _Method(_Shortened, PyMethod):
    pass


class _Property(_Shortened, PyProperty):
    pass

"""A Sphinx extension: autodoc reads docstrings in Markdown, comments behind fields, and short names of array types."""

import re
import sys
from dataclasses import fields, is_dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from sphinx.addnodes import desc_signature
from sphinx.application import Sphinx
from sphinx.domains.python import PyAttribute, PyFunction, PyMethod, PyProperty
from sphinx.domains.python._object import PyObject
from sphinx.ext.napoleon.docstring import GoogleDocstring
from sphinx.pycode import ModuleAnalyzer
from sphinx.util.typing import ExtensionMetadata

from swarmwire.comms.base.config import bounds_of

PARTS = ("comms", "agent", "world", "metrics", "deploy")
FIELD = re.compile(r"^(    (\w+): [^#\n]*  )# (?!noqa|pyright:)(.*)$", re.MULTILINE)
BARE = re.compile(r"^(    [a-z]\w*: [^#\n]*[^#\n,({\[])$(?!\n    \"\"\")", re.MULTILINE)  # with no comment, on one line
SPREAD = re.compile(r"^(    [a-z]\w*: [^#\n]* = parameter\(\n(?:        .*\n)+    \))$", re.MULTILINE)
SILENT = "–"
MARKUP = re.compile(r"[|*]|(?<=\w)_(?!\w)")  # |a|, *args, name_
NAMES = {"float64": "FloatArray", "int64": "IntArray", "bool": "BoolArray", "uint64": "KeyArray", "uint8": "ByteArray"}
ARRAY = re.compile(r"~?numpy\.ndarray\[tuple\[~?typing\.Any, \.\.\.\], ~?numpy\.dtype\[~?numpy\.(\w+)\]\]")
ARRAY_LIKE = re.compile(r"~?numpy\._typing\._array_like\._Buffer \| .*?_NestedSequence\[complex \| bytes \| str\]")


def setup(app: Sphinx) -> ExtensionMetadata:
    """Let autodoc read docstrings and comments as this project writes them, and shorten the types of arrays."""
    app.setup_extension("sphinx.ext.autodoc")
    app.connect("builder-inited", _read_field_comments)
    app.connect("autodoc-process-docstring", _prepare)
    kinds: dict[str, Any] = {"attribute": _Attribute, "function": _Function, "method": _Method, "property": _Property}
    for name, kind in kinds.items():
        app.add_directive_to_domain("py", name, kind, override=True)
    return {"version": "1", "parallel_read_safe": True}


def _prepare(_app: Sphinx, what: str, name: str, _of: Any, _options: Any, lines: list[str]) -> None:
    """Make reStructuredText of a docstring, in place.

    A module's is for its maintainers: the page says what it is about. Napoleon as it stands would take "value: what it
    means" in a property's docstring for a type and a meaning; ours are sentences.
    """
    if what == "module":
        lines.clear()
    elif lines and lines[0] == SILENT:
        lines[0] = _escaped(_help_of(name)) or SILENT
    elif lines:
        lines[:] = GoogleDocstring([_escaped(line) for line in lines], what="method").lines()


def _escaped(line: str) -> str:
    """The line with what Markdown takes for text, and reStructuredText for markup, kept as text; code is left alone."""
    parts = line.split("`")
    return "`".join(MARKUP.sub(r"\\\g<0>", part) if i % 2 == 0 else part for i, part in enumerate(parts))


def _help_of(path: str) -> str:
    """What `parameter` says of a field, by its full name; empty if it says nothing."""
    place, _, field = path.rpartition(".")
    module, _, name = place.rpartition(".")
    kind = getattr(sys.modules.get(module), name, None)
    limits = [bounds_of(of) for of in fields(kind) if of.name == field] if is_dataclass(kind) else []
    return "".join(f"{of.help}, in {of.unit}" if of.unit else of.help for of in limits)


def _read_field_comments(_app: Sphinx) -> None:
    """Let autodoc, which knows `#:` alone, take these comments for the fields' documentation.

    A field without one is `SILENT`: it speaks for itself, but it is listed.
    """
    for part in PARTS:
        spec = find_spec(f"swarmwire.{part}")
        for folder in (spec.submodule_search_locations or []) if spec else []:
            for path in Path(folder).rglob("*.py"):
                _read(path, Path(folder).parents[1])


def _read(path: Path, root: Path) -> None:
    module = ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__")
    source = FIELD.sub(r"\1#: \3", path.read_text(encoding="utf-8"))
    for silent in (BARE, SPREAD):
        source = silent.sub(rf"\1  #: {SILENT}", source)
    ModuleAnalyzer.cache["module", module] = ModuleAnalyzer.for_string(source, module, str(path))


def shortened(signature: str) -> str:
    """The signature with a name for every array type that has one in `swarmwire.comms.base.arrays`."""
    named = ARRAY.sub(lambda found: f"~swarmwire.comms.base.arrays.{NAMES[found[1]]}", signature)
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

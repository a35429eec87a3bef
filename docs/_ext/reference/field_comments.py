"""The comments behind fields, such as `heading_rad: float  # of its compass`, for the reference."""

import re
import sys
from dataclasses import fields, is_dataclass
from importlib.util import find_spec
from inspect import getsource
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx
from sphinx.pycode import ModuleAnalyzer

from swarmwire.comms.config import bounds_of

PARTS = ("comms", "agent", "world", "metrics", "deploy")
FIELD = re.compile(r"^(    (\w+): [^#\n]*  )# (?!noqa|pyright:)(.*)$", re.MULTILINE)
BARE = re.compile(r"^(    [a-z]\w*: [^#\n]*[^#\n,({\[])$(?!\n    \"\"\")", re.MULTILINE)  # with no comment, on one line
SPREAD = re.compile(r"^(    [a-z]\w*: [^#\n]* = parameter\(\n(?:        .*\n)+    \))$", re.MULTILINE)
SILENT = "–"


def comments_of(kind: type[Any]) -> dict[str, str]:
    """The comments behind the fields of a class and its bases in swarmwire, by name."""
    ours = [base for base in kind.__mro__ if base.__module__.startswith("swarmwire.")]
    return {name: text for base in reversed(ours) for _, name, text in FIELD.findall(getsource(base))}


def help_of(path: str) -> str:
    """What `parameter` says of a field, by its full name; empty if it says nothing."""
    place, _, field = path.rpartition(".")
    module, _, name = place.rpartition(".")
    kind = getattr(sys.modules.get(module), name, None)
    limits = [bounds_of(of) for of in fields(kind) if of.name == field] if is_dataclass(kind) else []
    return "".join(f"{of.help}, in {of.unit}" if of.unit else of.help for of in limits)


def teach_autodoc(_app: Sphinx) -> None:
    """Let autodoc, which knows `#:` alone, take these comments for the fields' documentation.

    A field without one is `SILENT`: it speaks for itself, but it is listed.
    """
    for part in PARTS:
        spec = find_spec(f"swarmwire.{part}")
        for folder in (spec.submodule_search_locations or []) if spec else []:
            for path in Path(folder).rglob("*.py"):
                _teach(path, Path(folder).parents[1])


def _teach(path: Path, root: Path) -> None:
    module = ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__")
    source = FIELD.sub(r"\1#: \3", path.read_text(encoding="utf-8"))
    for silent in (BARE, SPREAD):
        source = silent.sub(rf"\1  #: {SILENT}", source)
    ModuleAnalyzer.cache["module", module] = ModuleAnalyzer.for_string(source, module, str(path))

"""A check of `docs.checks`: comments behind the fields of classes that the API pages show begin with `#:`.

Sphinx reads only these; a comment that begins with `# ` would be absent from the page.
"""

import ast
import importlib
import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

from tests.docs.pages import PAGES, ROOT

DIRECTIVE = re.compile(r"^\.\. auto(?:class|module):: (swarmwire\.\S+)$", re.MULTILINE)
NOT_READ = re.compile(r"\s+# (?!noqa|pyright:)")


def field_comments() -> Iterator[str]:
    """Fields of the classes on the API pages have no comments that Sphinx does not read."""
    shown = {name for page in PAGES for name in DIRECTIVE.findall((ROOT / page).read_text(encoding="utf-8"))}
    classes = {base for name in shown for cls in _classes(name) for base in cls.__mro__}
    for cls in sorted(classes, key=lambda cls: f"{cls.__module__}.{cls.__qualname__}"):
        if cls.__module__.startswith("swarmwire."):
            yield from _unread(cls)


def _classes(name: str) -> list[type]:
    """The class with this name, or the public classes of the module with this name."""
    try:
        shown: ModuleType | type = importlib.import_module(name)
    except ModuleNotFoundError:
        module, _, class_name = name.rpartition(".")
        shown = getattr(importlib.import_module(module), class_name)
    if isinstance(shown, type):
        return [shown]
    public: list[str] = getattr(shown, "__all__", [name for name in vars(shown) if not name.startswith("_")])
    listed = [value for value in map(vars(shown).get, public) if inspect.isclass(value)]
    return [cls for cls in listed if hasattr(shown, "__all__") or cls.__module__ == shown.__name__]


def _unread(cls: type) -> Iterator[str]:
    """A line for each field of a class with a comment that Sphinx does not read."""
    file = Path(inspect.getfile(cls))
    lines = file.read_text(encoding="utf-8").splitlines()
    classes = [node for node in ast.walk(ast.parse("\n".join(lines))) if isinstance(node, ast.ClassDef)]
    statements = [node for each in classes if each.name == cls.__name__ for node in each.body]
    for field in (node for node in statements if isinstance(node, ast.AnnAssign)):
        after = lines[(field.end_lineno or 0) - 1].encode()[field.end_col_offset :].decode()
        name = ast.unparse(field.target)
        if not name.startswith("_") and NOT_READ.match(after):
            yield f"{file}:{field.lineno}: {cls.__name__}.{name}: expected a comment with #:"

"""Short names of array types in signatures: `FloatArray`, as the code writes it, for what numpy spells out."""

import re
from typing import Any

from sphinx.addnodes import desc_signature
from sphinx.application import Sphinx
from sphinx.domains.python import PyAttribute, PyFunction, PyMethod, PyProperty
from sphinx.domains.python._object import PyObject

NAMES = {"float64": "FloatArray", "int64": "IntArray", "bool": "BoolArray", "uint64": "KeyArray", "uint8": "ByteArray"}
ARRAY = re.compile(r"~?numpy\.ndarray\[tuple\[~?typing\.Any, \.\.\.\], ~?numpy\.dtype\[~?numpy\.(\w+)\]\]")
ARRAY_LIKE = re.compile(r"~?numpy\._typing\._array_like\._Buffer \| .*?_NestedSequence\[complex \| bytes \| str\]")


def shortened(signature: str) -> str:
    """The signature with a name for every array type that has one in `swarmwire.comms.arrays`."""
    named = ARRAY.sub(lambda found: f"~swarmwire.comms.arrays.{NAMES[found[1]]}", signature)
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


def shorten(app: Sphinx) -> None:
    """Have all that Sphinx describes of Python use the short names."""
    kinds: dict[str, Any] = {"attribute": _Attribute, "function": _Function, "method": _Method, "property": _Property}
    for name, kind in kinds.items():
        app.add_directive_to_domain("py", name, kind, override=True)

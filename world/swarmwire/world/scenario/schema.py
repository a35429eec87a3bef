"""The schema layer of scenarios: JSON schema nodes as text, and parameter dataclasses as pydantic tables.

`words` describes the expected value of a key, for errors and descriptions. `table_of` makes a pydantic model of a
dataclass made with `parameter`: one declaration defines validation, JSON schema and a frozen object.
"""

from dataclasses import MISSING, Field, dataclass, fields, is_dataclass
from decimal import Decimal
from functools import cache
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import pydantic
from pydantic import BaseModel, ConfigDict, GetCoreSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from swarmwire.comms.base.config import Bounds, bounds_of
from swarmwire.comms.base.errors import BadInput

Node = dict[str, Any]  # node of a JSON schema
BOUNDS = (
    ("minimum", "of at least"),
    ("exclusiveMinimum", "above"),
    ("maximum", "and at most"),
    ("exclusiveMaximum", "and below"),
)
TYPES = {
    "integer": "a whole number",
    "number": "a number",
    "string": "a text",
    "boolean": "true or false",
    "array": "a list",
    "object": "a table",
}


def plain(node: Node, schema: Node) -> Node:
    """Resolve a node's references, and remove "or null"."""
    while True:
        choices = [choice for choice in node.get("anyOf", []) if choice.get("type") != "null"]
        if len(choices) == 1:
            node = {**{k: v for k, v in node.items() if k != "anyOf"}, **choices[0]}
        elif "$ref" in node:
            node = schema["$defs"][node["$ref"].rpartition("/")[2]]
        else:
            return node


def forms(node: Node) -> list[Node]:
    """Return the nodes of a key with several forms, such as a text or a table; [] for other keys."""
    return [] if "discriminator" in node else node.get("oneOf", [])


def words(node: Node, schema: Node) -> str:
    """Describe the value that a node of the schema expects."""
    node = plain(node, schema)
    if "const" in node:
        return f"{node['const']}"
    if "enum" in node:
        return f"one of {', '.join(str(choice) for choice in node['enum'])}"
    if "anyOf" in node:
        return " or ".join(words(choice, schema) for choice in node["anyOf"])
    if forms(node):
        return " or ".join(words(choice, schema) for choice in forms(node))
    if "prefixItems" in node:
        inner = words(node["prefixItems"][0], schema).removeprefix("a ").replace("number", "numbers", 1)
        return f"a list of {len(node['prefixItems'])} {inner}"
    text = TYPES.get(node.get("type", "object"), "a table")
    bounds = [f"{side} {Decimal(str(node[bound])).normalize():f}" for bound, side in BOUNDS if bound in node]
    if bounds:
        text += " " + " ".join(bounds).removeprefix("and ")
    if node.get("minLength") or node.get("minItems") or node.get("minProperties"):
        text += " that is not empty"
    return text + (f" ({node['unit']})" if "unit" in node else "")


def words_of_bounds(kind: str, bounds: Bounds) -> str:
    """Describe the expected value of a parameter outside of scenarios: its kind, such as "a number", and its bounds.

    >>> words_of_bounds("a number", Bounds("share", at_least=0.0, at_most=1.0))
    'a number of at least 0 and at most 1'
    """
    if bounds.choices:
        return f"one of {', '.join(bounds.choices)}"
    limits = (bounds.at_least, bounds.above, bounds.at_most, bounds.below)
    texts = [f"{side} {limit:g}" for (_, side), limit in zip(BOUNDS, limits, strict=True) if limit is not None]
    return " ".join([kind, *texts]).replace(f"{kind} and ", f"{kind} ")


TABLE = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False, use_attribute_docstrings=True)
# The help of their keys comes from `parameter`; pydantic would search all modules of the process for each source.
PARAMETER_TABLE: ConfigDict = {**TABLE, "use_attribute_docstrings": False}
UNFIT = "unfit"  # type of an error of a table's validator, whose context has the key


@dataclass(frozen=True)
class AsTable:
    """Annotation of a field whose type is a parameter dataclass: read as a table, stored as the dataclass."""

    def __get_pydantic_core_schema__(self, source: type[Any], handler: GetCoreSchemaHandler) -> CoreSchema:
        """Return the schema of `source`'s table, followed by the construction of `source`."""
        form = written_form(source)

        def build(table: BaseModel) -> object:
            written = form(**{name: getattr(table, name) for name in type(table).model_fields})
            if form is source:
                return written
            try:
                return written.resolve()
            except BadInput as error:
                raise PydanticCustomError(UNFIT, "{expected}", {"key": error.key, "expected": error.expected}) from None

        return core_schema.no_info_after_validator_function(build, handler.generate_schema(table_of(source)))


@dataclass(frozen=True)
class OneOf:
    """Annotation of a field that stores one of several parameter dataclasses: `tag` is the key that selects one."""

    tag: str
    kinds: tuple[type[Any], ...]

    def __get_pydantic_core_schema__(self, source: type[Any], handler: GetCoreSchemaHandler) -> CoreSchema:
        """Return the schema of a table whose key `tag` chooses among `kinds`."""
        tables = Union[tuple(Annotated[kind, AsTable()] for kind in self.kinds)]  # noqa: UP007 - made at run time
        return handler.generate_schema(Annotated[tables, pydantic.Field(discriminator=self.tag)])


def form_of(value: object) -> str | None:
    """Return JSON schema's name for the type of a value, which chooses among several forms of a key."""
    match value:
        case str():
            return "string"
        case dict() | BaseModel():
            return "object"
        case list() | tuple():
            return "array"
        case _:
            return None


def written_form(kind: type[Any]) -> type[Any]:
    """Return the dataclass whose fields are the keys of `kind`'s table: its `written_as`, or else `kind` itself.

    Such a form has a method `resolve`, which returns the `kind`, or raises BadInput with a key of the table.
    """
    return getattr(kind, "written_as", kind)


@cache
def table_of(kind: type[Any]) -> type[BaseModel]:
    """Return the pydantic model of a dataclass made with `parameter`: same names, bounds, choices, units and help."""
    kind = written_form(kind)
    hints = get_type_hints(kind)
    columns: dict[str, Any] = {item.name: (_hint(hints[item.name], item), _field(item)) for item in fields(kind)}
    return pydantic.create_model(kind.__name__, __config__=PARAMETER_TABLE, __doc__=kind.__doc__, **columns)


def _hint(hint: Any, item: "Field[Any]") -> Any:
    limits = bounds_of(item)
    if limits.choices:
        choices: Any = Literal[limits.choices]
        return choices | None if item.default is None else choices
    if get_origin(hint) in (Union, UnionType):
        return Union[tuple(_readable(item) for item in get_args(hint))]  # noqa: UP007 - made at run time
    return _readable(hint)


def _readable(hint: Any) -> Any:
    if is_dataclass(hint):
        return Annotated[hint, AsTable()]
    if get_origin(hint) is tuple:
        items = tuple(item if item is ... else _readable(item) for item in get_args(hint))
        return Annotated[tuple[items], pydantic.Field(strict=False)]  # TOML has lists only
    return hint


def _field(item: "Field[Any]") -> Any:
    limits = bounds_of(item)
    keywords: dict[str, Any] = {"ge": limits.at_least, "le": limits.at_most, "gt": limits.above, "lt": limits.below}
    keywords = {name: bound for name, bound in keywords.items() if bound is not None}
    if limits.help:
        keywords["description"] = limits.help
    if limits.unit:
        keywords["json_schema_extra"] = {"unit": limits.unit}
    if item.default is not MISSING:
        keywords["default"] = item.default
    elif item.default_factory is not MISSING:
        keywords["default_factory"] = item.default_factory
    return pydantic.Field(**keywords)

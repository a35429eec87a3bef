"""Validation errors as one plain line: which key, what was expected. The words come from the JSON schema."""

from decimal import Decimal
from typing import Any, cast

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from swarmwire.comms.errors import BadInput

Node = dict[str, Any]
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


def fault(error: ValidationError, schema: Node, where: str) -> BadInput:
    """The first fault of a validation error, with the number of those that follow."""
    found = error.errors(include_url=False)
    key, expected = _explained(found[0], schema)
    more = f" (and {len(found) - 1} more fault{'s' if len(found) > 2 else ''})" if len(found) > 1 else ""
    return BadInput(where, key, expected + more)


def _explained(error: ErrorDetails, schema: Node) -> tuple[str, str]:
    names, node, holder = _followed(error["loc"], schema)
    kind, key, got = error["type"], ".".join(names), _shown(error["input"])
    if kind == "extra_forbidden":
        return key, f"unknown key; expected one of {', '.join(holder.get('properties', {}))}"
    if kind == "missing":
        return key, f"is missing; expected {_words(node, schema)}"
    if kind.startswith("union_tag"):
        tag = node["discriminator"]["propertyName"]
        choices = f"expected one of {', '.join(node['discriminator']['mapping'])}"
        if not isinstance(error["input"], dict):
            return key, f"expected a table, got {got}"
        given = cast("Node", error["input"])
        return f"{key}.{tag}", f"{choices}; got {_shown(given[tag])}" if tag in given else f"is missing; {choices}"
    if error["loc"][-1] == "[key]":
        return key, f"expected a name of at most 40 letters, digits and _ that starts with a letter, got {got}"
    if kind in ("place", "poses", "points"):  # worded by the scenario's own validators
        return key, error["msg"]
    return key, f"expected {_words(node, schema)}, got {got}"


def _followed(loc: tuple[int | str, ...], schema: Node) -> tuple[list[str], Node, Node]:
    """The keys that a location names, the schema's node there, and the node that holds it."""
    names: list[str] = []
    node = holder = schema
    for part in loc:
        node = _plain(node, schema)
        if "discriminator" in node:  # the part is the tag that chose the table, no key of the file
            node = {"$ref": node["discriminator"]["mapping"][part]}
        elif node.get("type") == "object":
            holder, names = node, [*names, str(part)]
            named, patterned = _table(node, "properties"), _table(node, "patternProperties")
            node = _table(named, str(part)) or next(iter(patterned.values()), Node())
        elif node.get("type") == "array":
            holder, names = node, [*names, str(part)]
            places = node.get("prefixItems", [])
            node = places[part] if isinstance(part, int) and part < len(places) else _table(node, "items")
    return [name for name in names if name != "[key]"], _plain(node, schema), holder


def _table(node: Node, name: str) -> Node:
    return node.get(name) or Node()


def _plain(node: Node, schema: Node) -> Node:
    """A node with references followed and "or null" left out."""
    while True:
        choices = [choice for choice in node.get("anyOf", []) if choice.get("type") != "null"]
        if len(choices) == 1:
            node = {**{k: v for k, v in node.items() if k != "anyOf"}, **choices[0]}
        elif "$ref" in node:
            node = schema["$defs"][node["$ref"].rpartition("/")[2]]
        else:
            return node


def _words(node: Node, schema: Node) -> str:
    """What a node of the schema expects, in words."""
    node = _plain(node, schema)
    if "const" in node:
        return f"{node['const']}"
    if "enum" in node:
        return f"one of {', '.join(str(choice) for choice in node['enum'])}"
    if "anyOf" in node:
        return " or ".join(_words(choice, schema) for choice in node["anyOf"])
    if "prefixItems" in node:
        inner = _words(node["prefixItems"][0], schema).removeprefix("a ").replace("number", "numbers", 1)
        return f"a list of {len(node['prefixItems'])} {inner}"
    words = TYPES.get(node.get("type", "object"), "a table")
    bounds = [f"{text} {Decimal(node[bound]):f}" for bound, text in BOUNDS if bound in node]
    if bounds:
        words += " " + " ".join(bounds).removeprefix("and ")
    if node.get("minLength") or node.get("minItems") or node.get("minProperties"):
        words += " that is not empty"
    return words + (f" ({node['unit']})" if "unit" in node else "")


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."

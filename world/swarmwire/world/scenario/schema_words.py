"""A JSON schema in words: what a key expects, as errors and descriptions say it."""

from decimal import Decimal
from typing import Any

Node = dict[str, Any]  # of a JSON schema
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
    """A node with references followed and "or null" left out."""
    while True:
        choices = [choice for choice in node.get("anyOf", []) if choice.get("type") != "null"]
        if len(choices) == 1:
            node = {**{k: v for k, v in node.items() if k != "anyOf"}, **choices[0]}
        elif "$ref" in node:
            node = schema["$defs"][node["$ref"].rpartition("/")[2]]
        else:
            return node


def forms(node: Node) -> list[Node]:
    """The nodes of a key that may be written in several forms, such as a text or a table; else none."""
    return [] if "discriminator" in node else node.get("oneOf", [])


def words(node: Node, schema: Node) -> str:
    """What a node of the schema expects, in words."""
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
    bounds = [f"{side} {Decimal(node[bound]):f}" for bound, side in BOUNDS if bound in node]
    if bounds:
        text += " " + " ".join(bounds).removeprefix("and ")
    if node.get("minLength") or node.get("minItems") or node.get("minProperties"):
        text += " that is not empty"
    return text + (f" ({node['unit']})" if "unit" in node else "")

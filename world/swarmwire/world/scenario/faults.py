"""Validation errors of a file's tables: pydantic's errors as one BadInput, with texts from the JSON schema."""

from typing import cast

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from swarmwire.comms.base.config import did_you_mean
from swarmwire.comms.base.errors import BadInput
from swarmwire.world.scenario.schema import UNFIT, Node, forms, plain, words

MAX_KEYS = 6  # further wrong keys that a message lists


def fault(error: ValidationError, schema: Node, where: str) -> BadInput:
    """Return the first fault of a validation error, with the keys of the others."""
    first, *others = (_explain(detail, schema) for detail in error.errors(include_url=False))
    keys = list(dict.fromkeys(key for key, _ in others))
    more = f" (also wrong: {', '.join(keys[:MAX_KEYS])}{', …' if len(keys) > MAX_KEYS else ''})" if keys else ""
    return BadInput(where, first[0], first[1] + more)


def _explain(error: ErrorDetails, schema: Node) -> tuple[str, str]:
    names, node, holder = _follow(error["loc"], schema)
    kind, key, got_text = error["type"], ".".join(names), _format(error["input"])
    if kind == "extra_forbidden":
        return key, f"unknown key; expected {did_you_mean(holder.get('properties', {}), names[-1])}"
    if kind == "missing":
        return key, f"is missing; expected {words(node, schema)}"
    if "discriminator" in node:  # one of several tables, chosen by a tag
        tag = node["discriminator"]["propertyName"]
        kinds = node["discriminator"]["mapping"]
        if not isinstance(error["input"], dict):
            return key, f"expected a table with {tag} = {did_you_mean(kinds)}; got {got_text}"
        table_input = cast("Node", error["input"])
        choices = f"expected {did_you_mean(kinds, table_input.get(tag))}"
        return (
            f"{key}.{tag}",
            f"{choices}; got {_format(table_input[tag])}" if tag in table_input else f"is missing; {choices}",
        )
    if error["loc"][-1] == "[key]":
        return key, f"expected a name of at most 40 letters, digits and _ that starts with a letter, got {got_text}"
    if kind == UNFIT:
        return f"{key}.{error.get('ctx', {})['key']}", error["msg"]
    if kind in ("place", "poses", "points", "stop"):  # the text comes from a validator of the scenario
        return key, error["msg"]
    if "patternProperties" in holder and node.get("type") == "object":
        return key, f"expected a table for each group, [{'.'.join(names[:-1])}.GROUP], got {got_text}"
    expected = did_you_mean(map(str, node["enum"]), error["input"]) if "enum" in node else words(node, schema)
    return key, f"expected {expected}, got {got_text}"


def _follow(loc: tuple[int | str, ...], schema: Node) -> tuple[list[str], Node, Node]:
    """Return the keys of a location, its schema node, and the parent node."""
    names: list[str] = []
    node = holder = schema
    for part in loc:
        node = plain(node, schema)
        if "discriminator" in node:  # the part is the tag of a table, no key of the file
            node = {"$ref": node["discriminator"]["mapping"][part]}
        elif forms(node):  # the part is the type of a form, no key of the file
            node = next(form for form in forms(node) if plain(form, schema).get("type") == part)
        elif node.get("type") == "object":
            holder, names = node, [*names, str(part)]
            named, patterned = _table(node, "properties"), _table(node, "patternProperties")
            node = _table(named, str(part)) or next(iter(patterned.values()), _table(node, "additionalProperties"))
        elif node.get("type") == "array":
            holder, names = node, [*names, str(part)]
            items = node.get("prefixItems", [])
            node = items[part] if isinstance(part, int) and part < len(items) else _table(node, "items")
    return [name for name in names if name != "[key]"], plain(node, schema), holder


def _table(node: Node, name: str) -> Node:
    value = node.get(name)
    return cast("Node", value) if isinstance(value, dict) else Node()


def _format(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."

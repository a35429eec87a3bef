"""Validation errors as one plain line: which key, what was expected. The words come from the JSON schema."""

from typing import cast

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from swarmwire.comms.config import one_of
from swarmwire.comms.errors import BadInput
from swarmwire.world.scenario.schema import UNFIT
from swarmwire.world.scenario.schema_words import Node, forms, plain, words

MOST_KEYS = 6  # that are named after the first fault


def fault(error: ValidationError, schema: Node, where: str) -> BadInput:
    """The first fault of a validation error, with the keys of those that follow."""
    first, *others = (_explained(of, schema) for of in error.errors(include_url=False))
    keys = list(dict.fromkeys(key for key, _ in others))
    more = f" (also wrong: {', '.join(keys[:MOST_KEYS])}{', …' if len(keys) > MOST_KEYS else ''})" if keys else ""
    return BadInput(where, first[0], first[1] + more)


def _explained(error: ErrorDetails, schema: Node) -> tuple[str, str]:
    names, node, holder = _followed(error["loc"], schema)
    kind, key, got = error["type"], ".".join(names), _shown(error["input"])
    if kind == "extra_forbidden":
        return key, f"unknown key; expected {one_of(holder.get('properties', {}), names[-1])}"
    if kind == "missing":
        return key, f"is missing; expected {words(node, schema)}"
    if "discriminator" in node:  # one of several tables, by their tag
        tag = node["discriminator"]["propertyName"]
        kinds = node["discriminator"]["mapping"]
        if not isinstance(error["input"], dict):
            return key, f"expected a table with {tag} = {one_of(kinds)}; got {got}"
        given = cast("Node", error["input"])
        choices = f"expected {one_of(kinds, given.get(tag))}"
        return f"{key}.{tag}", f"{choices}; got {_shown(given[tag])}" if tag in given else f"is missing; {choices}"
    if error["loc"][-1] == "[key]":
        return key, f"expected a name of at most 40 letters, digits and _ that starts with a letter, got {got}"
    if kind == UNFIT:
        return f"{key}.{error.get('ctx', {})['key']}", error["msg"]
    if kind in ("place", "poses", "points", "stop"):  # worded by the scenario's own validators
        return key, error["msg"]
    if "patternProperties" in holder and node.get("type") == "object":
        return key, f"expected a table for each group, [{'.'.join(names[:-1])}.GROUP], got {got}"
    expected = one_of(map(str, node["enum"]), error["input"]) if "enum" in node else words(node, schema)
    return key, f"expected {expected}, got {got}"


def _followed(loc: tuple[int | str, ...], schema: Node) -> tuple[list[str], Node, Node]:
    """The keys that a location names, the schema's node there, and the node that holds it."""
    names: list[str] = []
    node = holder = schema
    for part in loc:
        node = plain(node, schema)
        if "discriminator" in node:  # the part is the tag that chose the table, no key of the file
            node = {"$ref": node["discriminator"]["mapping"][part]}
        elif forms(node):  # the part tells the form, no key of the file either
            node = next(form for form in forms(node) if plain(form, schema).get("type") == part)
        elif node.get("type") == "object":
            holder, names = node, [*names, str(part)]
            named, patterned = _table(node, "properties"), _table(node, "patternProperties")
            node = _table(named, str(part)) or next(iter(patterned.values()), Node())
        elif node.get("type") == "array":
            holder, names = node, [*names, str(part)]
            places = node.get("prefixItems", [])
            node = places[part] if isinstance(part, int) and part < len(places) else _table(node, "items")
    return [name for name in names if name != "[key]"], plain(node, schema), holder


def _table(node: Node, name: str) -> Node:
    return node.get(name) or Node()


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."

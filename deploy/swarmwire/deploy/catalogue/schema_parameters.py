"""Parameters as a JSON schema declares them: every key by its path, with unit, default and what it expects."""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Any

from swarmwire.deploy.catalogue.docs import first_line
from swarmwire.deploy.catalogue.entry import Parameter
from swarmwire.deploy.catalogue.units import unit_of
from swarmwire.world.scenario.schema import Node, forms, plain, table_of, words


@cache  # the schema of a class takes milliseconds, and a list of bodies asks for the same dozen hundreds of times
def parameters_of_dataclass(kind: type[Any]) -> tuple[Parameter, ...]:
    """The parameters of a dataclass made with `parameter`, those of nested ones by their path."""
    return parameters_of_schema(table_of(kind).model_json_schema())


def parameters_of_schema(schema: Node) -> tuple[Parameter, ...]:
    """The keys of a table's schema, depth first, each after the table that holds it."""
    return tuple(_keys(schema, schema, ""))


def _keys(node: Node, schema: Node, prefix: str) -> Iterator[Parameter]:
    for name, key in node.get("properties", {}).items():
        yield _parameter(prefix + name, key, schema, required=name in node.get("required", ()))
        yield from _below(plain(key, schema), schema, prefix + name)


def _below(node: Node, schema: Node, path: str) -> Iterator[Parameter]:
    """The keys below the one at `path`."""
    if "discriminator" in node:
        yield from _chosen(node, schema, path)
    elif "patternProperties" in node:
        for table in node["patternProperties"].values():
            yield _parameter(f"{path}.*", table, schema, required=False)
            yield from _below(plain(table, schema), schema, f"{path}.*")
    elif forms(node):  # the same keys in a list of tables as in one
        tables = [form for form in forms(node) if plain(form, schema).get("type") == "object"]
        yield from _below(plain(tables[0], schema), schema, path)
    elif "items" in node:
        yield from _below(plain(node["items"], schema), schema, f"{path}.*")
    else:
        yield from _keys(node, schema, f"{path}.")


def _chosen(node: Node, schema: Node, path: str) -> Iterator[Parameter]:
    """The keys of several tables of which a tag (`shape`, `how`, `do`) chooses one, each key once."""
    tag, tables = node["discriminator"]["propertyName"], node["discriminator"]["mapping"]
    found: dict[str, dict[str, Parameter]] = {}
    for choice, reference in tables.items():
        for key in _keys(plain({"$ref": reference}, schema), schema, f"{path}."):
            found.setdefault(key.name, {})[choice] = key
    yield replace(_joined(found.pop(f"{path}.{tag}")), value=None, required=True)
    for keys in found.values():
        only = "" if len(keys) == len(tables) else f" (only with {tag} = {' or '.join(keys)})"
        joined = _joined(keys)
        yield replace(joined, help=joined.help + only)


def _joined(keys: dict[str, Parameter]) -> Parameter:
    """One key that means the like in several tables, by what chooses the table."""
    helps, expected = {key.help for key in keys.values()}, dict.fromkeys(key.expected for key in keys.values())
    several = "; ".join(f"{choice}: {key.help}" for choice, key in keys.items())
    first = next(iter(keys.values()))
    return replace(first, help=several if len(helps) > 1 else first.help, expected=" or ".join(expected))


def _parameter(path: str, key: Node, schema: Node, required: bool) -> Parameter:
    node = plain(key, schema)
    value, unit = key.get("default"), key.get("unit", node.get("unit", unit_of(path)))
    return Parameter(
        name=path,
        help=first_line(key.get("description", node.get("description"))),
        unit=unit,
        value=None if isinstance(value, dict) else value,  # a table's defaults stand at its keys
        required=required,
        expected=words({name: of for name, of in node.items() if name != "unit"}, schema),
    )

"""Entries of the catalogue with tables of parameters, which also JSON schemas give."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from swarmwire.deploy.terminal.output import first_line, flowing
from swarmwire.world.scenario.schema import Node, forms, plain, table_of, words


@dataclass(frozen=True)
class CatalogueParameter:
    """A parameter of a thing."""

    name: str  # path within the thing: "response.reach_m"; `*` stands for the name of a group or an index of a list
    help: str
    unit: str = ""
    value: Any = None  # default, or figure of a data sheet; None: no value
    required: bool = False  # True if it has no default
    expected: str = ""  # text on the allowed values
    text: str = ""  # paragraphs on its table, or on each of its choices


@dataclass(frozen=True)
class ParameterTable:
    """Parameters under a title; `value_is` names the meaning of their values: "default", "value" or "lost"."""

    title: str
    parameters: tuple[CatalogueParameter, ...]
    value_is: str = "default"


@dataclass(frozen=True)
class CatalogueEntry:
    """A named thing."""

    kind: str  # "body", "metric", …
    name: str
    help: str  # one line
    facts: tuple[tuple[str, str], ...] = ()  # title and text: unit, source, use in a scenario, …
    tables: tuple[ParameterTable, ...] = ()
    mark: str = ""  # word beside the name in lists: "standard"
    text: str = ""  # paragraphs with an empty line between two

    def parameters(self) -> tuple[CatalogueParameter, ...]:
        """Return the parameters of all tables."""
        return tuple(parameter for table in self.tables for parameter in table.parameters)


ITEMS = {"string": "texts", "number": "numbers", "object": "tables", "array": "lists"}
UNITS = {
    "_per_s": "1/s",
    "_ticks": "ticks",
    "_bytes": "byte",
    "_radps": "rad/s",
    "_mps2": "m/s^2",
    "_mps": "m/s",
    "_bps": "bit/s",
    "_dbm": "dBm",
    "_deg": "deg",
    "_rad": "rad",
    "_mhz": "MHz",
    "_khz": "kHz",
    "_db": "dB",
    "_hz": "Hz",
    "_kg": "kg",
    "_nm": "N m",
    "_ns": "ns",
    "_ms": "ms",
    "_m": "m",
    "_n": "N",
    "_s": "s",
}  # longer endings first


def unit_of(name: str) -> str:
    """Return the unit at the end of a name; empty if it has none.

    >>> unit_of("turn_gain_per_s"), unit_of("speed_mps"), unit_of("cohesion")
    ('1/s', 'm/s', '')
    """
    return next((unit for end, unit in UNITS.items() if name.endswith(end)), "")


@cache  # a schema takes milliseconds, and a list of bodies needs the same dozen hundreds of times
def parameters_of_dataclass(kind: type[Any]) -> tuple[CatalogueParameter, ...]:
    """Return the parameters of a dataclass of `parameter` fields, also of nested ones."""
    return parameters_of_schema(table_of(kind).model_json_schema())


def parameters_of_schema(schema: Node) -> tuple[CatalogueParameter, ...]:
    """Return the keys of a table's schema, depth first, each after its table."""
    return tuple(_keys(schema, schema, ""))


def _keys(node: Node, schema: Node, prefix: str) -> Iterator[CatalogueParameter]:
    for name, key in node.get("properties", {}).items():
        yield _parameter(prefix + name, key, schema, required=name in node.get("required", ()))
        yield from _below(plain(key, schema), schema, prefix + name)


def _below(node: Node, schema: Node, path: str) -> Iterator[CatalogueParameter]:
    """Return the keys below the key at `path`."""
    if "discriminator" in node:
        yield from _chosen(node, schema, path)
    elif "patternProperties" in node:
        for table in node["patternProperties"].values():
            yield _parameter(f"{path}.*", table, schema, required=False)
            yield from _below(plain(table, schema), schema, f"{path}.*")
    elif forms(node):  # a list of tables has the same keys as one table
        tables = [form for form in forms(node) if plain(form, schema).get("type") == "object"]
        yield from _below(plain(tables[0], schema), schema, path)
    elif "items" in node:
        yield from _below(plain(node["items"], schema), schema, f"{path}.*")
    else:
        yield from _keys(node, schema, f"{path}.")


def _chosen(node: Node, schema: Node, path: str) -> Iterator[CatalogueParameter]:
    """Return the keys of several tables of which a tag (`shape`, `how`, `do`) chooses one, each key once."""
    tag, references = node["discriminator"]["propertyName"], node["discriminator"]["mapping"]
    tables = {choice: plain({"$ref": reference}, schema) for choice, reference in references.items()}
    by_name: dict[str, dict[str, CatalogueParameter]] = {}
    for choice, table in tables.items():
        for key in _keys(table, schema, f"{path}."):
            by_name.setdefault(key.name, {})[choice] = key
    text = "\n\n".join(f'`{tag} = "{choice}"`: {flowing(table.get("description"))}' for choice, table in tables.items())
    yield replace(_joined(by_name.pop(f"{path}.{tag}")), value=None, required=True, text=text)
    for keys in by_name.values():
        only = "" if len(keys) == len(tables) else f" (only with {tag} = {' or '.join(keys)})"
        joined = _joined(keys)
        yield replace(joined, help=joined.help + only)


def _joined(keys: dict[str, CatalogueParameter]) -> CatalogueParameter:
    """Join a key of several tables, by the choice of the table; defaults that differ become part of the help."""
    first, expected = next(iter(keys.values())), dict.fromkeys(key.expected for key in keys.values())
    differ = any(key.value != first.value for key in keys.values())
    helps = {
        choice: f"{key.help} (default {key.value})" if differ and key.value else key.help
        for choice, key in keys.items()
    }
    several = "; ".join(f"{choice}: {text}" for choice, text in helps.items())
    text = several if len(set(helps.values())) > 1 else first.help
    return replace(first, value=None if differ else first.value, help=text, expected=" or ".join(expected))


def _parameter(path: str, key: Node, schema: Node, required: bool) -> CatalogueParameter:
    node = plain(key, schema)
    value, unit = key.get("default"), key.get("unit", node.get("unit", unit_of(path)))
    description = key.get("description", node.get("description"))
    inner = plain(node["items"], schema) if "items" in node else node
    text = inner.get("description", description)
    return CatalogueParameter(
        name=path,
        help=first_line(description),
        unit=unit,
        value=None if isinstance(value, dict) else value,  # a table's defaults stand at its keys
        required=required,
        expected=_expected(node, schema),
        text="" if flowing(text).removesuffix(".") == first_line(description) else flowing(text),
    )


def _expected(node: Node, schema: Node) -> str:
    text = words({name: value for name, value in node.items() if name != "unit"}, schema)
    items = plain(node.get("items", {}), schema).get("type")
    return text.replace("a list", f"a list of {ITEMS[items]}", 1) if items in ITEMS else text

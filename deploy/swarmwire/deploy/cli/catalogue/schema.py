"""Entries of the catalogue with tables of parameters, and how a JSON schema becomes such parameters."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from swarmwire.deploy.cli.catalogue.docstrings import first_line, flowing
from swarmwire.world.scenario.schema import Node, forms, plain, table_of, words


@dataclass(frozen=True)
class CatalogueParameter:
    """One value that a thing has or takes."""

    name: str  # a path within the thing: "response.reach_m"; `*` is the name of a group or the place in a list
    help: str
    unit: str = ""
    value: Any = None  # the default, or the figure of a data sheet; None: there is none
    required: bool = False  # it must be given
    expected: str = ""  # which values it may take, in words
    text: str = ""  # paragraphs on the table that it holds, or on each of its choices


@dataclass(frozen=True)
class ParameterTable:
    """Parameters under one title, and what their `value` is: "default" or "value"."""

    title: str
    parameters: tuple[CatalogueParameter, ...]
    value_is: str = "default"


@dataclass(frozen=True)
class CatalogueEntry:
    """One thing that has a name."""

    kind: str  # as in `kind:name`: "body", "metric", …
    name: str
    help: str  # one line
    facts: tuple[tuple[str, str], ...] = ()  # title and text: its unit, its source, how a scenario names it, …
    tables: tuple[ParameterTable, ...] = ()
    mark: str = ""  # a word that lists show beside the name: "standard"
    text: str = ""  # paragraphs with an empty line between two

    def parameters(self) -> tuple[CatalogueParameter, ...]:
        """Those of all tables."""
        return tuple(of for table in self.tables for of in table.parameters)


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
}  # longer ends first


def unit_of(name: str) -> str:
    """The unit at the end of a name; empty if it has none.

    >>> unit_of("turn_gain_per_s"), unit_of("speed_mps"), unit_of("cohesion")
    ('1/s', 'm/s', '')
    """
    return next((unit for end, unit in UNITS.items() if name.endswith(end)), "")


@cache  # the schema of a class takes milliseconds, and a list of bodies asks for the same dozen hundreds of times
def parameters_of_dataclass(kind: type[Any]) -> tuple[CatalogueParameter, ...]:
    """The parameters of a dataclass made with `parameter`, those of nested ones by their path."""
    return parameters_of_schema(table_of(kind).model_json_schema())


def parameters_of_schema(schema: Node) -> tuple[CatalogueParameter, ...]:
    """The keys of a table's schema, depth first, each after the table that holds it."""
    return tuple(_keys(schema, schema, ""))


def _keys(node: Node, schema: Node, prefix: str) -> Iterator[CatalogueParameter]:
    for name, key in node.get("properties", {}).items():
        yield _parameter(prefix + name, key, schema, required=name in node.get("required", ()))
        yield from _below(plain(key, schema), schema, prefix + name)


def _below(node: Node, schema: Node, path: str) -> Iterator[CatalogueParameter]:
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


def _chosen(node: Node, schema: Node, path: str) -> Iterator[CatalogueParameter]:
    """The keys of several tables of which a tag (`shape`, `how`, `do`) chooses one, each key once."""
    tag, references = node["discriminator"]["propertyName"], node["discriminator"]["mapping"]
    tables = {choice: plain({"$ref": reference}, schema) for choice, reference in references.items()}
    found: dict[str, dict[str, CatalogueParameter]] = {}
    for choice, table in tables.items():
        for key in _keys(table, schema, f"{path}."):
            found.setdefault(key.name, {})[choice] = key
    text = "\n\n".join(f'`{tag} = "{choice}"`: {flowing(of.get("description"))}' for choice, of in tables.items())
    yield replace(_joined(found.pop(f"{path}.{tag}")), value=None, required=True, text=text)
    for keys in found.values():
        only = "" if len(keys) == len(tables) else f" (only with {tag} = {' or '.join(keys)})"
        joined = _joined(keys)
        yield replace(joined, help=joined.help + only)


def _joined(keys: dict[str, CatalogueParameter]) -> CatalogueParameter:
    """One key that means the like in several tables, by what chooses the table."""
    helps, expected = {key.help for key in keys.values()}, dict.fromkeys(key.expected for key in keys.values())
    several = "; ".join(f"{choice}: {key.help}" for choice, key in keys.items())
    first = next(iter(keys.values()))
    return replace(first, help=several if len(helps) > 1 else first.help, expected=" or ".join(expected))


def _parameter(path: str, key: Node, schema: Node, required: bool) -> CatalogueParameter:
    node = plain(key, schema)
    value, unit = key.get("default"), key.get("unit", node.get("unit", unit_of(path)))
    told = key.get("description", node.get("description"))
    inner = plain(node["items"], schema) if "items" in node else node
    text = inner.get("description", told)
    return CatalogueParameter(
        name=path,
        help=first_line(told),
        unit=unit,
        value=None if isinstance(value, dict) else value,  # a table's defaults stand at its keys
        required=required,
        expected=_expected(node, schema),
        text="" if flowing(text).removesuffix(".") == first_line(told) else flowing(text),
    )


def _expected(node: Node, schema: Node) -> str:
    text = words({name: of for name, of in node.items() if name != "unit"}, schema)
    items = plain(node.get("items", {}), schema).get("type")
    return text.replace("a list", f"a list of {ITEMS[items]}", 1) if items in ITEMS else text

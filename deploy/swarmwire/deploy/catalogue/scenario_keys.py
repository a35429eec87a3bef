"""Keys of a scenario by their path, from its schema: those of the radio apart from all others."""

from dataclasses import replace
from functools import cache

from swarmwire.deploy.catalogue.entry import Entry, Parameter, ParameterTable
from swarmwire.deploy.catalogue.schema_parameters import parameters_of_schema
from swarmwire.world.scenario_file import scenario_schema


def keys() -> list[Entry]:
    """All keys but those of the radio."""
    return [_key(of, "key") for of in all_keys() if not _of_radio(of)]


def radio_keys() -> list[Entry]:
    """The keys of the radio."""
    return [_key(of, "radio") for of in all_keys() if _of_radio(of)]


@cache
def all_keys() -> tuple[Parameter, ...]:
    """Every key of a scenario, each after the table that holds it."""
    return parameters_of_schema(scenario_schema())


def _of_radio(key: Parameter) -> bool:
    return key.name == "radio" or key.name.startswith("radio.")


def _key(key: Parameter, kind: str) -> Entry:
    inner = f"{key.name}."
    below = tuple(replace(of, name=of.name.removeprefix(inner)) for of in all_keys() if of.name.startswith(inner))
    table = ParameterTable(f"keys of {key.name}", below) if below else ParameterTable("key", (key,))
    return Entry(
        kind=kind,
        name=key.name,
        help=key.help,
        facts=(("in a scenario", _place(key, bool(below))),),
        tables=(table,),
    )


def _place(key: Parameter, is_table: bool) -> str:
    """Where the file has it, as TOML writes that."""
    if is_table:
        in_list = key.expected.startswith("a list")
        return f"the tables {_header(f'{key.name}.*')}" if in_list else f"the table {_header(key.name)}"
    table, _, name = key.name.rpartition(".")
    return f"{name} in {_header(table)}" if table else f"{name}, before the first table"


def _header(path: str) -> str:
    """The header of a table: "[robots.GROUP]", or "[[events]]" for one of a list."""
    lists = {of.name for of in all_keys() if of.expected.startswith("a list")}
    parts = path.split(".")
    places = [part == "*" and ".".join(parts[:depth]) in lists for depth, part in enumerate(parts)]
    shown = ".".join("GROUP" if part == "*" else part for part, place in zip(parts, places, strict=True) if not place)
    return f"[[{shown}]]" if places[-1] else f"[{shown}]"

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
    table, _, name = key.name.rpartition(".")
    star = "; * is a group's name or a place in a list" if "*" in key.name else ""
    if is_table:
        return f"the table {key.name}{star}"
    return (f"{name} in [{table}]" if table else f"{name}, before the first table") + star

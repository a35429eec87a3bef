"""The keys of a scenario, from its JSON schema: a table for each table of the file."""

from functools import cache
from typing import Any

from reference.markdown import NOTHING, code, sentence, table, toml, toml_code
from reference.schema_values import variants_of, without_null, words_of
from swarmwire.world.scenario_file import scenario_schema

HEAD = ("key", "value", "default", "meaning")


@cache
def schema() -> dict[str, Any]:
    """The JSON schema of a scenario."""
    return scenario_schema()


def key_tables(path: str = "") -> str:
    """The keys of the table at `path` ("" for the file's own), and after them those of every table within."""
    return "\n".join(_tables(path, _at(path), set()))


def tables_of(path: str, definition: str, tag: str, seen: set[str]) -> list[str]:
    """The tables of one variant, which its key `tag` tells, and of what it holds; those `seen` already are left out."""
    variant = schema()["$defs"][definition]
    return _tables(path, {**variant, "required": [*variant.get("required", []), tag]}, seen)


def _at(path: str) -> dict[str, Any]:
    """The schema of the table at a path such as "radio" or "robots"."""
    whole = schema()
    if not path:  # tables of the file's own have sections of their own
        flat = {key: value for key, value in whole["properties"].items() if not _within(value)}
        return {**whole, "properties": flat}
    return _within(whole["properties"][path])[0][1]


def _tables(path: str, of: dict[str, Any], seen: set[str]) -> list[str]:
    found = [table(HEAD, [_row(key, value, key in of.get("required", [])) for key, value in of["properties"].items()])]
    for key, value in of["properties"].items():
        for tag, inner in _within(value):
            if inner["title"] in seen:
                continue
            seen.add(inner["title"])
            inner_path = ".".join(part for part in (path, key) if part)
            found.append(
                f"{code(inner_path)}{f', {code(tag)}' if tag else ''}: {sentence(inner.get('description', ''))}\n"
            )
            if inner.get("properties"):
                found += _tables(inner_path, inner, seen)
    return found


def _row(key: str, value: dict[str, Any], required: bool) -> tuple[str, str, str, str]:
    inner = _within(value)
    default = "required" if required else NOTHING if inner else toml_code(value.get("default"))
    means = value.get("description") or (inner[0][1].get("description", "") if inner else "")
    return code(key), words_of(without_null(value)), default, sentence(means)


def _within(value: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """The tables that a key may hold: what tells each from the others ("" if there is one), and its schema."""
    return [
        (f"{tag} = {toml(name)}" if tag else "", schema()["$defs"][definition])
        for tag, name, definition in variants_of(without_null(value))
    ]

"""From a file, a mapping and `--set` overrides to a checked scenario; every fault is one BadInput."""

import tomllib
from collections.abc import Mapping, Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any, cast

from pydantic import ValidationError

from swarmwire.comms.errors import BadInput
from swarmwire.world.scenario.checks import check
from swarmwire.world.scenario.faults import fault
from swarmwire.world.scenario.scenario import Scenario


def scenario_schema() -> dict[str, Any]:
    """The JSON schema of a scenario's file, with bounds, units and a description of every key."""
    return Scenario.model_json_schema()


def scenario_from(mapping: Mapping[str, Any], where: str, overrides: Sequence[str] = ()) -> Scenario:
    """The scenario of a mapping, after `overrides` such as "robots.flock.count=30" (a TOML value, else a text).

    BadInput names `where`, or the override, the key and what was expected.
    """
    given = deepcopy(dict(mapping))
    settings = [(_put(given, *_parsed(text)), text) for text in overrides]
    try:
        return _checked(given, where)
    except BadInput as error:
        for key, text in reversed(settings):
            if f"{error.key}.".startswith(f"{key}."):  # the fault is the override's, not the scenario's
                raise BadInput(f"--set {text}", error.key, error.expected) from None
        raise


def load_scenario(path: Path | str, overrides: Sequence[str] = ()) -> Scenario:
    """The scenario in a TOML file, after `overrides` as for `scenario_from`."""
    return scenario_from(_read(path, str(path)), str(path), overrides)


def _checked(given: dict[str, Any], where: str) -> Scenario:
    try:
        scenario = Scenario.model_validate(given)
    except ValidationError as error:
        raise fault(error, scenario_schema(), where) from None
    check(scenario, where)
    return scenario.with_source(where, deepcopy(given))


def _read(path: Path | str, where: str) -> dict[str, Any]:
    try:
        return tomllib.loads(Path(path).read_text(encoding="utf-8-sig"))
    except tomllib.TOMLDecodeError as error:
        raise BadInput(where, "", f"expected TOML: {error}") from None
    except UnicodeDecodeError:
        raise BadInput(where, "", "expected TOML, which is UTF-8 text") from None
    except OSError as error:
        raise BadInput(where, "", f"expected a readable file: {error.strerror}") from None


def _parsed(text: str) -> tuple[list[str], Any, str]:
    path, equals, value = text.partition("=")
    keys = [key.strip() for key in path.split(".")]
    if not equals or not all(keys):
        raise BadInput(f"--set {text}", "", "expected path=value, such as robots.flock.count=30")
    try:
        found = tomllib.loads(f"value = {value}")
    except tomllib.TOMLDecodeError:
        return keys, value.strip(), text
    return keys, found["value"] if len(found) == 1 else value, text


def _put(mapping: dict[str, Any], keys: list[str], value: Any, text: str) -> str:
    """Set the value at a path of keys, in which a number is a place in a list; the path of what is new with it."""
    at: Any = mapping
    new = len(keys)  # keys that lead to what is new
    for depth, key in enumerate(keys):
        if isinstance(at, list):
            items = cast("list[Any]", at)
            if not key.isdecimal() or int(key) >= len(items):
                expected = f"expected a place in a list of {len(items)}, counted from 0"
                raise BadInput(f"--set {text}", ".".join(keys[: depth + 1]), expected)
            holder, index = cast(Any, items), int(key)
        elif isinstance(at, dict):
            holder, index = cast(Any, at), key
        else:
            raise BadInput(f"--set {text}", ".".join(keys[: depth + 1]), f"{'.'.join(keys[:depth])} holds no keys")
        if isinstance(at, dict) and key not in at:
            new = min(new, depth + 1)
        if depth == len(keys) - 1:
            holder[index] = value
        else:
            at = holder[index] if isinstance(at, list) else holder.setdefault(index, {})
    return ".".join(keys[:new])

"""Reading scenarios: from a file, a mapping and `--set` overrides to a checked `Scenario`.

Overrides (`--set path=value`) change the mapping before the checks. Every fault is one BadInput.
"""

import tomllib
from collections.abc import Mapping, Sequence
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import Any, cast

from pydantic import ValidationError

from swarmwire.comms.base.config import check_format, did_you_mean, from_toml, scenario_path
from swarmwire.comms.base.errors import BadInput
from swarmwire.world.scenario.faults import fault
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.validation import check

FORMAT = 1  # the format number in a scenario's file


def apply_override(mapping: dict[str, Any], text: str) -> str:
    """Set the value of an override at its path, in which a number is an index of a list.

    Returns the path of the first new key, or the complete path. BadInput if the path does not exist.
    """
    keys, value = _parsed(text)
    node: Any = mapping
    new = len(keys)  # number of keys up to the first new key
    for depth, key in enumerate(keys):
        if isinstance(node, list):
            items = cast("list[Any]", node)
            if not key.isdecimal() or int(key) >= len(items):
                expected = f"expected an index in a list of {len(items)}, counted from 0"
                raise BadInput(f"--set {text}", ".".join(keys[: depth + 1]), expected)
            container, index = cast(Any, items), int(key)
        elif isinstance(node, dict):
            container, index = cast(Any, node), key
        else:
            raise BadInput(f"--set {text}", ".".join(keys[: depth + 1]), f"{'.'.join(keys[:depth])} holds no keys")
        if isinstance(node, dict) and key not in node:
            new = min(new, depth + 1)
        if depth == len(keys) - 1:
            container[index] = value
        else:
            node = container[index] if isinstance(node, list) else container.setdefault(index, {})
    return ".".join(keys[:new])


def _parsed(text: str) -> tuple[list[str], Any]:
    path, equals, value = text.partition("=")
    keys = [key.strip() for key in path.split(".")]
    if not equals or not all(keys):
        raise BadInput(f"--set {text}", "", "expected path=value, such as robots.flock.count=30")
    try:
        parsed = from_toml(f"value = {value}")
    except tomllib.TOMLDecodeError:
        return keys, value.strip()
    return keys, parsed["value"] if len(parsed) == 1 else value


def scenario_schema() -> dict[str, Any]:
    """Return the JSON schema of a scenario's file, with bounds, units and a description of every key."""
    return deepcopy(_schema())


@cache
def _schema() -> dict[str, Any]:
    return Scenario.model_json_schema()  # slower than loading a scenario


def scenario_from(mapping: Mapping[str, Any], where: str, overrides: Sequence[str] = ()) -> Scenario:
    """Return the scenario of a mapping, after `overrides` such as "robots.flock.count=30" (a TOML value, else a text).

    BadInput names `where`, or the override, the key and what was expected.
    """
    mapping_copy = deepcopy(dict(mapping))
    settings = [(apply_override(mapping_copy, text), text) for text in overrides]
    try:
        return _checked(mapping_copy, where)
    except BadInput as error:
        for key, text in reversed(settings):
            if f"{error.key}.".startswith(f"{key}."):  # the fault is the override's, not the scenario's
                raise BadInput(f"--set {text}", error.key, error.expected + _existing_groups(mapping, key)) from None
        raise


def _existing_groups(mapping: Mapping[str, Any], key: str) -> str:
    """Return the end of an error about an override at `key` that adds a group of robots: the existing groups."""
    table, _, group = key.partition(".")
    groups = mapping.get("robots")
    if table != "robots" or not isinstance(groups, dict) or not group or group.split(".")[0] in groups:
        return ""
    return f"; or an existing group, {did_you_mean(cast('dict[str, Any]', groups), group)}"


def load_scenario(path: Path | str, overrides: Sequence[str] = ()) -> Scenario:
    """Return the scenario in a TOML file or of a swarm's folder, after `overrides`; see `scenario_from`."""
    file = scenario_path(path)
    return scenario_from(_read(file), str(file), overrides)


def _checked(mapping_copy: dict[str, Any], where: str) -> Scenario:
    check_format(mapping_copy, FORMAT, where)
    try:
        scenario = Scenario.model_validate(mapping_copy)
    except ValidationError as error:
        raise fault(error, _schema(), where) from None
    check(scenario, where)
    return scenario.with_source(where, deepcopy(mapping_copy))


def _read(path: Path) -> dict[str, Any]:
    where = str(path)
    try:
        return from_toml(path.read_text(encoding="utf-8-sig"))
    except tomllib.TOMLDecodeError as error:
        raise BadInput(where, "", f"expected TOML: {error}") from None
    except UnicodeDecodeError:
        raise BadInput(where, "", "expected TOML, which is UTF-8 text") from None
    except OSError as error:
        raise BadInput(where, "", f"expected a readable file: {error.strerror}") from None

"""A scenario as the mapping that describes it: the way back from `scenario_from`, for whoever writes it to a file."""

from copy import deepcopy
from dataclasses import fields, is_dataclass
from typing import Any, cast

from pydantic import BaseModel

from swarmwire.world.scenario.scenario import Scenario


def mapping_of(scenario: Scenario) -> dict[str, Any]:
    """The mapping that gives an equal scenario: texts, numbers, lists and tables only.

    It is the mapping that the scenario was read from, as long as it still describes it; a scenario that was made or
    changed in Python is taken apart instead, and then says defaults of radio and events, too. The mapping is the
    caller's own.
    """
    given = scenario.given
    if given is not None and same_content(Scenario.model_validate(given), scenario):
        return deepcopy(given)
    return cast("dict[str, Any]", _plain(scenario))


def same_content(one: Scenario, other: Scenario) -> bool:
    """Whether two scenarios say the same, wherever they come from."""
    return all(getattr(one, name) == getattr(other, name) for name in Scenario.model_fields)


def _plain(value: object) -> object:
    if isinstance(value, BaseModel):
        names = [name for name in type(value).model_fields if name in value.model_fields_set]
        return _table({**{name: getattr(value, name) for name in names}, **(value.model_extra or {})})
    if is_dataclass(value) and not isinstance(value, type):
        return _table({of.name: getattr(value, of.name) for of in fields(value)})
    if isinstance(value, dict):
        return _table(cast("dict[str, object]", value))
    if isinstance(value, list | tuple):
        return [_plain(item) for item in cast("list[object]", value)]
    return value


def _table(items: dict[str, object]) -> dict[str, object]:
    """TOML has no word for None: what is None is left out."""
    return {name: _plain(item) for name, item in items.items() if item is not None}

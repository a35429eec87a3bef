"""Presets: kinds of radio that a scenario may name."""

from typing import Any, cast

from swarmwire.comms.radio.config.presets import PRESETS, Preset
from swarmwire.deploy.catalogue.entry import Entry


def presets() -> list[Entry]:
    """All presets, with the values that they give."""
    return [_preset(name, preset) for name, preset in PRESETS.items()]


def _preset(name: str, preset: Preset) -> Entry:
    values = tuple((f"radio.{path}", str(value)) for path, value in _flat(preset.radio))
    otherwise = (("but", preset.otherwise),) if preset.otherwise else ()
    facts = (("in a scenario", f'[radio] preset = "{name}"'), ("source", preset.source), *otherwise, *values)
    return Entry(kind="preset", name=name, help=preset.told, facts=facts)


def _flat(table: dict[str, Any], path: str = "") -> list[tuple[str, Any]]:
    found: list[tuple[str, Any]] = []
    for key, value in table.items():
        is_table = isinstance(value, dict) and bool(cast("dict[str, Any]", value))
        found += _flat(cast("dict[str, Any]", value), f"{path}{key}.") if is_table else [(path + key, value)]
    return found

"""Presets: kinds of radio as tables of a scenario's `[radio]`, each with the source of its figures.

A preset gives values where the scenario gives none; what the scenario says wins, key by key, within tables, too.
"""

from collections.abc import Mapping
from copy import deepcopy
from typing import Any, cast

from swarmwire.comms.air.presets.disks import DISKS
from swarmwire.comms.air.presets.other_media import OTHER_MEDIA
from swarmwire.comms.air.presets.preset import Preset
from swarmwire.comms.air.presets.simulators import SIMULATORS
from swarmwire.comms.air.presets.standards import STANDARDS

PATH_LOSS = ("log_distance", "two_ray", "itu_indoor")
PRESETS: dict[str, Preset] = {**DISKS, **STANDARDS, **SIMULATORS, **OTHER_MEDIA}  # by name


def with_preset(radio: Mapping[str, Any]) -> dict[str, Any]:
    """The radio's table with the values of its preset, if it names a known one, where it has none itself."""
    name = radio.get("preset")
    preset = PRESETS.get(name) if isinstance(name, str) else None
    if preset is None:
        return dict(radio)
    values = dict(preset.radio)
    if radio.get("model", values["model"]) != values["model"]:  # another model's path loss goes with it
        values = {key: value for key, value in values.items() if key not in PATH_LOSS}
    return _filled(radio, values)


def _filled(given: Mapping[str, Any], defaults: Mapping[str, Any]) -> dict[str, Any]:
    filled = deepcopy(dict(given))
    for key, value in defaults.items():
        if isinstance(value, dict) and isinstance(filled.get(key), dict):
            filled[key] = _filled(cast("dict[str, Any]", filled[key]), cast("dict[str, Any]", value))
        else:
            filled.setdefault(key, deepcopy(cast(object, value)))
    return filled

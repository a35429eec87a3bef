"""A radio without a run: a preset with values set by path, and checks of a table [radio] on its own."""

from collections.abc import Mapping, Sequence
from typing import Any

from swarmwire.comms.config import did_you_mean
from swarmwire.comms.errors import BadInput
from swarmwire.comms.radio.config.presets import PRESETS
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.world.scenario_file import scenario_from


def radio_of(preset: str, settings: Sequence[str]) -> Radio:
    """The radio of a preset after settings such as "radio.loss=0.1"; BadInput if there is none, or for a bad value."""
    if preset not in PRESETS:
        raise BadInput("radio", "", f"expected {did_you_mean(PRESETS, preset)}; got {preset!r}")
    radio = checked_radio({"preset": preset}, "radio", settings)
    if radio.trace is not None:
        raise BadInput("radio", "radio.trace", "expected none: links are measured between robots of a scenario")
    return radio


def checked_radio(table: Mapping[str, Any], where: str, overrides: Sequence[str] = ()) -> Radio:
    """The radio of a table after overrides such as "radio.loss=0.1"; BadInput as for a scenario."""
    around = {
        "format": 1,
        "name": "a radio",
        "duration_s": 1.0,
        "arena": {"size_m": [2.0, 2.0]},
        "robots": {"nodes": {"body": "epuck", "count": 1, "agent": "none:None"}},
    }
    radio = scenario_from({**around, "radio": table}, where, overrides).radio
    assert radio is not None
    return radio

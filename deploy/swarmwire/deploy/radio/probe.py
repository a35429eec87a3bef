"""A radio without a scenario of its own: a preset, with values set by path."""

from collections.abc import Sequence

from swarmwire.comms.air.presets.registry import PRESETS
from swarmwire.comms.air.radio import Radio
from swarmwire.comms.errors import BadInput
from swarmwire.comms.one_of import one_of
from swarmwire.world.scenario.scenario_file import scenario_from, with_settings


def radio_of(preset: str, settings: Sequence[str]) -> Radio:
    """The radio of a preset after settings such as "radio.loss=0.1"; BadInput if there is none, or for a bad value."""
    if preset not in PRESETS:
        raise BadInput("radio", "", f"expected {one_of(PRESETS, preset)}; got {preset!r}")
    scenario = {
        "format": 1,
        "name": "probe",
        "duration_s": 1.0,
        "arena": {"size_m": [2.0, 2.0]},
        "robots": {"nodes": {"body": "epuck", "count": 1, "agent": "none:None"}},
        "radio": {"preset": preset},
    }
    radio = scenario_from(with_settings(scenario, settings), "radio").radio
    assert radio is not None
    if radio.trace is not None:
        raise BadInput("radio", "radio.trace", "expected none: links are measured between robots of a scenario")
    return radio

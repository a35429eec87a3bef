"""A radio without a scenario of its own: a preset, with values set by path."""

from collections.abc import Sequence

from swarmwire.comms.config import did_you_mean
from swarmwire.comms.errors import BadInput
from swarmwire.comms.radio.config.presets import PRESETS
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.deploy.radio.around import checked_radio


def radio_of(preset: str, settings: Sequence[str]) -> Radio:
    """The radio of a preset after settings such as "radio.loss=0.1"; BadInput if there is none, or for a bad value."""
    if preset not in PRESETS:
        raise BadInput("radio", "", f"expected {did_you_mean(PRESETS, preset)}; got {preset!r}")
    radio = checked_radio({"preset": preset}, "radio", settings)
    if radio.trace is not None:
        raise BadInput("radio", "radio.trace", "expected none: links are measured between robots of a scenario")
    return radio

"""The presets of the radio, from their tables."""

import numpy as np

from reference.markdown import NOTHING, code, number, table
from swarmwire.comms.radio.config.presets import PRESETS
from swarmwire.comms.radio.config.radio import airtime_ns
from swarmwire.comms.radio.phy.propagation import range_of
from swarmwire.deploy.radio.probe import radio_of

HEADS = ["preset", "what it is", "reach, m", "longest frame, ms", "but"]


def preset_table() -> str:
    """Each preset, how far it reaches by path loss alone, how long its longest frame takes, and what it leaves out."""
    return table(HEADS, [_row(name) for name in PRESETS])


def preset_sources() -> str:
    """Where each preset's figures come from."""
    return "".join(f"- {code(name)}: {preset.source}\n" for name, preset in PRESETS.items())


def _row(name: str) -> list[str]:
    radio, preset = radio_of(name, []), PRESETS[name]
    reach_m = range_of(radio)
    longest_ms = float(airtime_ns(radio, np.array([radio.overhead_bytes + radio.max_payload_bytes]))[0]) / 1e6
    reach = NOTHING if reach_m is None else number(float(f"{reach_m:.3g}"))
    return [code(name), preset.told, reach, number(float(f"{longest_ms:.3g}")), preset.otherwise or NOTHING]

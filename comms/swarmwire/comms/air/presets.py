"""Presets: kinds of radio as tables of a scenario's `[radio]`, each with the source of its figures.

A preset gives values where the scenario gives none; what the scenario says wins, key by key, within tables, too.
"""

from collections.abc import Mapping
from copy import deepcopy
from typing import Any, NamedTuple, cast


class Preset(NamedTuple):
    """A kind of radio."""

    told: str  # what it is
    source: str  # of its figures
    radio: dict[str, Any]  # keys of [radio]


_IEEE_802_15_4: dict[str, Any] = {
    "model": "log-distance",
    "frequency_hz": 2.44e9,
    "bit_rate_bps": 250_000,
    "overhead_bytes": 17,
    "max_payload_bytes": 116,
    "log_distance": {"exponent": 3.0},
    "antenna": {"power_dbm": 0.0},
    "noise": {"bandwidth_hz": 2e6, "figure_db": 9.5},
    "reception": {"model": "802.15.4", "preamble_sinr_db": -5.0},
    "access": {"method": "csma-802154"},
}
_WIFI: dict[str, Any] = {
    "model": "log-distance",
    "overhead_bytes": 64,
    "max_payload_bytes": 1472,
    "queue_limit": 500,
    "log_distance": {"exponent": 3.0},
    "antenna": {"power_dbm": 16.0},
    "access": {"method": "dcf"},
}
PRESETS: dict[str, Preset] = {
    "ideal": Preset(
        "reaches everywhere, loses nothing, takes next to no time",
        "what abstract swarm models assume",
        {"model": "disk", "range_m": 10_000.0, "line_of_sight": False, "bit_rate_bps": 10**9},
    ),
    "disk": Preset("reaches 2 m, up to the next obstacle", "unit disk graphs", {"model": "disk", "range_m": 2.0}),
    "bernoulli": Preset(
        "a disk that loses every tenth packet",
        "the independent losses of textbooks",
        {"model": "disk", "range_m": 2.0, "loss": 0.1},
    ),
    "gilbert": Preset(
        "a disk whose links fail for half a second in ten",
        "E. N. Gilbert, Bell Syst. Tech. J. 39, 1960",
        {"model": "disk", "range_m": 2.0, "bursts": {"bad_s": 0.5, "good_s": 10.0}},
    ),
    "argos-rab": Preset(
        "ARGoS's range and bearing of the foot-bot: 3 m in line of sight, 10 bytes, from step to step",
        "ARGoS 3, ci_range_and_bearing, the foot-bot's entity, and rab_medium for what blocks",
        {
            "model": "disk",
            "range_m": 3.0,
            "line_of_sight": True,
            "bodies_block": True,
            "max_payload_bytes": 10,
            "bit_rate_bps": 10**9,
            "send_offset": "tick",
            "gives": {"range": {}, "bearing": {}},
        },
    ),
    "infrared-epuck": Preset(
        "ARGoS's range and bearing of the e-puck: 0.8 m in line of sight, 2 bytes beside the tag",
        "ARGoS 3, the e-puck's entity, and rab_medium for what blocks",
        {
            "model": "disk",
            "range_m": 0.8,
            "line_of_sight": True,
            "bodies_block": True,
            "max_payload_bytes": 4,
            "bit_rate_bps": 10**9,
            "send_offset": "tick",
            "gives": {"range": {}, "bearing": {}},
        },
    ),
    "ieee802154": Preset(
        "IEEE 802.15.4 at 2.4 GHz, 0 dBm, sensitivity -101 dBm, unslotted CSMA/CA, short addresses",
        "IEEE 802.15.4-2006; sensitivity of the AT86RF233's data sheet; preamble as in ns-3",
        _IEEE_802_15_4,
    ),
    "wifi-b-1M": Preset(
        "IEEE 802.11b ad hoc at 1 Mbit/s in channel 1, UDP over IPv4",
        "IEEE 802.11-2007; power, noise figure and preamble as in ns-3",
        {
            **_WIFI,
            "frequency_hz": 2.412e9,
            "bit_rate_bps": 1_000_000,
            "frame": "802.11b",
            "noise": {"bandwidth_hz": 22e6, "figure_db": 7.0},
            "reception": {
                "model": "802.11b",
                "preamble_sinr_db": 4.0,
                "preamble_dbm": -94.0,
                "sensitivity_dbm": -94.0,  # its bits would need less, but without a preamble there are none
                "take_over_s": 4e-6,
            },
        },
    ),
    "wifi-a-6M": Preset(
        "IEEE 802.11a ad hoc at 6 Mbit/s in channel 36, UDP over IPv4",
        "IEEE 802.11-2007; power, noise figure and preamble as in ns-3",
        {
            **_WIFI,
            "frequency_hz": 5.18e9,
            "bit_rate_bps": 6_000_000,
            "frame": "802.11a",
            "noise": {"bandwidth_hz": 20e6, "figure_db": 7.0},
            "reception": {
                "model": "802.11ag",
                "preamble_sinr_db": 4.0,
                "preamble_dbm": -82.0,
                "sensitivity_dbm": -82.0,
                "take_over_s": 4e-6,
            },
        },
    ),
}


def with_preset(radio: Mapping[str, Any]) -> dict[str, Any]:
    """The radio's table with the values of its preset, if it names a known one, where it has none itself."""
    name = radio.get("preset")
    preset = PRESETS.get(name) if isinstance(name, str) else None
    return _filled(radio, preset.radio) if preset else dict(radio)


def _filled(given: Mapping[str, Any], defaults: Mapping[str, Any]) -> dict[str, Any]:
    filled = deepcopy(dict(given))
    for key, value in defaults.items():
        if isinstance(value, dict) and isinstance(filled.get(key), dict):
            filled[key] = _filled(cast("dict[str, Any]", filled[key]), cast("dict[str, Any]", value))
        else:
            filled.setdefault(key, deepcopy(cast(object, value)))
    return filled

"""Presets of radio standards, with the timing that they prescribe."""

from typing import Any

from swarmwire.comms.air.presets.preset import Preset
from swarmwire.comms.air.presets.success import fsk_success

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
STANDARDS: dict[str, Preset] = {
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
            "reception": {"model": "802.11b", "preamble_sinr_db": 4.0, "preamble_dbm": -94.0, "take_over_s": 4e-6},
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
            "reception": {"model": "802.11ag", "preamble_sinr_db": 4.0, "preamble_dbm": -82.0, "take_over_s": 4e-6},
        },
    ),
    "ble-1M": Preset(
        "Bluetooth LE advertising at 1 Mbit/s, 0 dBm, sensitivity -96 dBm: 27 bytes, sent without listening",
        "Bluetooth Core Specification 5.4, 6.B; sensitivity of the nRF54L15's data sheet, at 0.1 % of bits wrong",
        {
            "model": "log-distance",
            "frequency_hz": 2.402e9,
            "bit_rate_bps": 1_000_000,
            # Preamble 1, access address 4, header 2, advertiser 6, check 3; of the data: length, type, company 4.
            "overhead_bytes": 20,
            "max_payload_bytes": 27,
            "log_distance": {"exponent": 3.0},
            "antenna": {"power_dbm": 0.0},
            "noise": {"bandwidth_hz": 1e6, "figure_db": 7.04},  # what makes the sensitivity of it
            "reception": {
                "model": "table",
                "table": fsk_success(),
                "preamble_sinr_db": 5.0,  # below it hardly any access address is right
                "sensitivity_dbm": -96.0,
            },
            "access": {"method": "aloha"},
        },
        "one channel, where advertisers send on three in turn, and a scanner that never pauses; errors are those of "
        "binary FSK, with interference as noise",
    ),
}

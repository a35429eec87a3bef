"""Presets with the figures of other simulators' radios, for scenarios that come from there."""

from typing import Any

from swarmwire.comms.air.presets.preset import Preset
from swarmwire.comms.air.presets.success import qpsk_success_of_bytes

_GAZEBO: dict[str, Any] = {
    "model": "log-distance",
    "max_payload_bytes": 1500,
    "shadowing": {"deviation_db": 10.0, "correlation_m": 1.0},
    "noise": {"bandwidth_hz": 20e6, "figure_db": 10.965},  # -90 dBm
    "reception": {"model": "table", "table": qpsk_success_of_bytes(), "preamble_sinr_db": -10.0},
    "access": {"method": "none"},
}
_SPREAD_AND_RATE = (
    "the spread of 10 dB stays with the place, where the simulator draws it anew for each packet; what exceeds the bit "
    "rate waits, where the simulator drops it"
)
SIMULATORS: dict[str, Preset] = {
    "gz-rfcomms": Preset(
        "Gazebo's RFComms as it comes: 27 dBm, 40 dB + 25 log d, 50 m at most, 54 Mbit/s, no interference",
        "gz-sim, systems/rf_comms/RFComms.cc, defaults; constant below 1 m, where it has no bound",
        {
            **_GAZEBO,
            "range_m": 50.0,
            "bit_rate_bps": 54_000_000,
            "log_distance": {"exponent": 2.5, "reference_loss_db": 40.0},
            "antenna": {"power_dbm": 27.0},
        },
        _SPREAD_AND_RATE,
    ),
    "subt": Preset(
        "the DARPA SubT simulator's: 20 dBm, 40 dB + 15 log(0.55 d), 500 m at most, 1 Mbit/s, no interference",
        "osrf/subt, competition.ign and subt_rf_interface; 0.2 x 10 log(0.55 x 50 m) = 3 dB per unit of visibility",
        {
            **_GAZEBO,
            "range_m": 500.0,
            "bit_rate_bps": 1_000_000,
            "log_distance": {"exponent": 1.5, "reference_loss_db": 36.105},  # 40 dB + 15 log 0.55
            "antenna": {"power_dbm": 20.0},
            "walls": {"crossing_db": 3.0},
        },
        f"{_SPREAD_AND_RATE}; 3 dB in each obstacle stand for its table of visibility, which raises the exponent by "
        "0.2 per unit and cuts off at 10; there are no breadcrumbs",
    ),
}

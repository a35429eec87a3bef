"""Presets: kinds of radio as tables of a scenario's `[radio]`, each with the source of its figures.

A preset fills in the keys that a scenario leaves out, also within tables.
"""

from collections.abc import Mapping
from copy import deepcopy
from typing import Any, NamedTuple, cast

from swarmwire.comms.base import math as portable


class Preset(NamedTuple):
    """A kind of radio."""

    summary: str
    source: str
    radio: dict[str, Any]  # keys of [radio]
    differences: str = ""  # between this emulation and the radio of its name


# Success tables of modulations without an error model.


STEP_DB, MAX_FSK_DB = 0.5, 18.0
DIGITS = 9  # one bit in a billion is negligible in a frame


def fsk_success() -> dict[str, Any]:
    """Return the success table of a bit in non-coherent binary FSK: bit errors 0.5 exp(-SINR / 2).

    Source: J. G. Proakis, Digital Communications. GFSK with Bluetooth's deviation is no better. With one bit per symbol
    and a bandwidth equal to the bit rate, SINR is Eb/N0.
    """
    sinr_db = [STEP_DB * row for row in range(round(MAX_FSK_DB / STEP_DB) + 1)]
    success = [round(1.0 - 0.5 * portable.exp(-0.5 * portable.power(10.0, 0.1 * db)), DIGITS) for db in sinr_db]
    return {"sinr_db": sinr_db, "success": success, "frame_bits": 1}


# Presets of fixed range: models of textbooks, and range and bearing of simulated robots.


DISKS: dict[str, Preset] = {
    "ideal": Preset(
        "reaches everywhere, loses nothing, takes next to no time",
        "what abstract swarm models assume",
        {"model": "unit-disk", "range_m": 10_000.0, "line_of_sight": False, "bit_rate_bps": 10**9},
    ),
    "unit-disk": Preset(
        "reaches 2 m, up to the next obstacle", "unit disk graphs", {"model": "unit-disk", "range_m": 2.0}
    ),
    "bernoulli": Preset(
        "a unit disk that loses every tenth packet",
        "the independent losses of textbooks",
        {"model": "unit-disk", "range_m": 2.0, "loss": 0.1},
    ),
    "gilbert": Preset(
        "a unit disk whose links fail for half a second in ten",
        "E. N. Gilbert, Bell Syst. Tech. J. 39, 1960",
        {"model": "unit-disk", "range_m": 2.0, "bursts": {"bad_s": 0.5, "good_s": 10.0}},
    ),
    "argos-rab": Preset(
        "ARGoS's range and bearing of the foot-bot: 3 m in line of sight, 10 bytes, from step to step",
        "ARGoS 3, ci_range_and_bearing, the foot-bot's entity, and rab_medium for what blocks",
        {
            "model": "unit-disk",
            "range_m": 3.0,
            "line_of_sight": True,
            "bodies_block": True,
            "max_payload_bytes": 10,
            "bit_rate_bps": 10**9,
            "send_offset": "tick",
            "measures": {"range": {}, "bearing": {}},
        },
    ),
    "infrared-epuck": Preset(
        "ARGoS's range and bearing of the e-puck: 0.8 m in line of sight, 2 bytes beside the tag",
        "ARGoS 3, the e-puck's entity, and rab_medium for what blocks",
        {
            "model": "unit-disk",
            "range_m": 0.8,
            "line_of_sight": True,
            "bodies_block": True,
            "max_payload_bytes": 4,
            "bit_rate_bps": 10**9,
            "send_offset": "tick",
            "measures": {"range": {}, "bearing": {}},
        },
    ),
}


# Presets with the figures of other simulators' radios.


_GAZEBO: dict[str, Any] = {
    "model": "log-distance",
    "max_payload_bytes": 1500,
    "shadowing": {"deviation_db": 10.0, "correlation_m": 1.0},
    "noise": {"bandwidth_hz": 20e6, "figure_db": 10.965},  # -90 dBm
    "reception": {"model": "gazebo", "preamble_sinr_db": -10.0},
    "access": {"method": "none"},
}
_SPREAD_AND_RATE = (
    "the spread of 10 dB stays with the place, where the simulator draws it again for each packet; what exceeds the "
    "bit rate waits, where the simulator drops it"
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


def _crazyradio(bit_rate_bps: int, sensitivity_dbm: float) -> "Preset":
    """Return the preset of a Crazyradio; its noise figure follows from the sensitivity, at 0.1 % of bits wrong."""
    sinr_db = 10.0 * portable.log10(-2.0 * portable.log(2.0 * 1e-3))  # as in `fsk_success`
    thermal_dbm = -173.975 + 10.0 * portable.log10(float(bit_rate_bps))
    kilobits = bit_rate_bps // 1000
    rate = f"{kilobits // 1000} Mbit/s" if kilobits >= 1000 else f"{kilobits} kbit/s"
    return Preset(
        f"Bitcraze's Crazyradio PA and Crazyflies at {rate}, 20 dBm, sensitivity {sensitivity_dbm:g} dBm: a station "
        "polls, drones answer; 32 bytes",
        "Nordic, nRF24LU1+ Product Specification v1.0, 5.2, 6.3 and 6.4; crazyradio-firmware, radio.c; Bitcraze, "
        "Crazyradio PA",
        {
            "model": "log-distance",
            "frequency_hz": 2.48e9,  # channel 80, the default of cflib and of the firmware
            "bit_rate_bps": bit_rate_bps,
            "frame": "esb",
            "overhead_bytes": 8,  # preamble 1, address 5, check 2; the frame adds 9 bits of packet control
            "max_payload_bytes": 32,
            "queue_limit": 64,
            "log_distance": {"exponent": 3.0},
            "antenna": {"power_dbm": 20.0},
            "noise": {
                "bandwidth_hz": float(bit_rate_bps),
                "figure_db": round(sensitivity_dbm - sinr_db - thermal_dbm, 2),
            },
            "reception": {
                "model": "table",
                "table": fsk_success(),
                "preamble_sinr_db": 5.0,  # below it, hardly any address is received
                "sensitivity_dbm": sensitivity_dbm,
            },
            "access": {"method": "esb"},
        },
        "stations share one channel; a receiver locks to frames with other addresses, too; the sensitivity is that of "
        "the chip without the amplifier for reception; without access.safelink, which cflib has, a packet ends after "
        "ARC repetitions",
    )


# Presets of radio standards, with their timing.


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
    "queue_lifetime_s": 0.5,
    "log_distance": {"exponent": 3.0},
    "antenna": {"power_dbm": 16.0},
    "access": {"method": "dcf"},
}
_WIFI_N: dict[str, Any] = {
    **_WIFI,
    "bit_rate_bps": 65_000_000,
    "overhead_bytes": 66,  # two bytes of QoS control beyond those of 802.11a
    "frame": "802.11n",
    "noise": {"bandwidth_hz": 20e6, "figure_db": 7.0},
    "reception": {"model": "802.11ag", "preamble_sinr_db": 4.0, "preamble_dbm": -82.0, "capture_window_s": 4e-6},
}
_LORA: dict[str, Any] = {
    "model": "log-distance",
    "frame": "lora",
    "overhead_bytes": 4,
    "max_payload_bytes": 251,
    "log_distance": {"exponent": 3.0},
    "noise": {"figure_db": 6.0},
    "access": {"method": "aloha"},
}
_LORA_DIFFERENCES = "the decoder is a threshold of SINR, without bit errors; one channel"
STANDARDS: dict[str, Preset] = {
    "ieee802154": Preset(
        "IEEE 802.15.4 at 2.4 GHz, 0 dBm, sensitivity -101 dBm, unslotted CSMA/CA, short addresses",
        "IEEE 802.15.4-2006; sensitivity of the AT86RF233's data sheet; preamble as in ns-3",
        _IEEE_802_15_4,
    ),
    "wifi-b-1M": Preset(
        "IEEE 802.11b ad hoc at 1 Mbit/s in channel 1, UDP over IPv4",
        "IEEE 802.11-2007; power, noise figure, preamble and queue as in ns-3",
        {
            **_WIFI,
            "frequency_hz": 2.412e9,
            "bit_rate_bps": 1_000_000,
            "frame": "802.11b",
            # Error rates take Eb/N0 = SINR x 22 MHz / rate, so the noise is that of 22 MHz; ns-3 has that of 20 MHz.
            "noise": {"bandwidth_hz": 22e6, "figure_db": 7.0},
            "reception": {"model": "802.11b", "preamble_sinr_db": 4.0, "preamble_dbm": -82.0, "capture_window_s": 4e-6},
        },
    ),
    "wifi-a-6M": Preset(
        "IEEE 802.11a ad hoc at 6 Mbit/s in channel 36, UDP over IPv4",
        "IEEE 802.11-2007; power, noise figure, preamble and queue as in ns-3",
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
                "capture_window_s": 4e-6,
            },
        },
    ),
    "wifi-n-2G": Preset(
        "IEEE 802.11n ad hoc at 65 Mbit/s (MCS 7, one stream, 20 MHz) in channel 1, UDP over IPv4",
        "IEEE 802.11n-2009; power, noise figure, preamble and queue as in ns-3",
        {**_WIFI_N, "frequency_hz": 2.412e9},
    ),
    "wifi-n-5G": Preset(
        "IEEE 802.11n ad hoc at 65 Mbit/s (MCS 7, one stream, 20 MHz) in channel 36, UDP over IPv4",
        "IEEE 802.11n-2009; power, noise figure, preamble and queue as in ns-3",
        {**_WIFI_N, "frequency_hz": 5.18e9},
    ),
    "lora-eu868": Preset(
        "LoRa (SX127x) at 868.1 MHz: SF7, 125 kHz, 14 dBm, sensitivity -124.5 dBm, without listening, duty cycle 1 %",
        "Semtech, SX1276 data sheet, rev. 7; ETSI EN 300 220-2, band of 868.0 to 868.6 MHz; RadioHead's header",
        {
            **_LORA,
            "frequency_hz": 868.1e6,
            "antenna": {"power_dbm": 14.0},
            "lora": {"duty_cycle": 0.01},
        },
        _LORA_DIFFERENCES,
    ),
    "lora-us915": Preset(
        "LoRa (SX127x) at 903.9 MHz: SF7, 125 kHz, 20 dBm, sensitivity -124.5 dBm, without listening, dwell 0.4 s",
        "Semtech, SX1276 data sheet, rev. 7; 47 CFR 15.247 (a) (1) (i); RadioHead's header",
        {
            **_LORA,
            "frequency_hz": 903.9e6,
            "antenna": {"power_dbm": 20.0},
            "lora": {"max_airtime_s": 0.4},
        },
        f"{_LORA_DIFFERENCES}, also where the law demands hopping",
    ),
    "ble-1M": Preset(
        "Bluetooth LE advertising at 1 Mbit/s, 0 dBm, sensitivity -96 dBm: 27 bytes, on three channels in turn",
        "Bluetooth Core Specification 5.4, 6.B; sensitivity of the nRF54L15's data sheet, at 0.1 % of bits wrong; gap "
        "and scan interval of Zephyr's controller and host",
        {
            "model": "log-distance",
            "frequency_hz": 2.402e9,
            "bit_rate_bps": 1_000_000,
            # Preamble 1, access address 4, header 2, advertiser 6, check 3; of the data: length, type, company 4.
            "overhead_bytes": 20,
            "max_payload_bytes": 27,
            "log_distance": {"exponent": 3.0},
            "antenna": {"power_dbm": 0.0},
            "noise": {"bandwidth_hz": 1e6, "figure_db": 7.04},  # gives the sensitivity of the data sheet
            "reception": {
                "model": "table",
                "table": fsk_success(),
                "preamble_sinr_db": 5.0,  # below it, hardly any access address is received
                "sensitivity_dbm": -96.0,
            },
            "access": {"method": "advertising"},
        },
        "the three channels have one path loss, though that at 2480 MHz is 0.28 dB above that at 2402 MHz; errors are "
        "those of binary FSK, with interference as noise",
    ),
    "crazyradio-250k": _crazyradio(250_000, -94.0),
    "crazyradio-1M": _crazyradio(1_000_000, -85.0),
    "crazyradio-2M": _crazyradio(2_000_000, -82.0),
}


# Presets of other media: infrared light, and sound in water.
#
# Sound is in dBm of acoustic power: a level in dB re 1 uPa minus 140.8 dB is the power through a sphere of 1 m.


OTHER_MEDIA: dict[str, Preset] = {
    "kilobot": Preset(
        "the Kilobot's infrared: 0.1 m, 9 bytes beside the tag, 30 kbit/s, carrier sense, distances to 2 mm",
        "M. Rubenstein et al., ICRA 2012; kilolib, message.h",
        {
            "model": "log-distance",
            "range_m": 0.1,
            "line_of_sight": True,
            "bit_rate_bps": 30_000,
            "overhead_bytes": 1,  # two bytes of the tag replace the type and half of the checksum
            "max_payload_bytes": 11,
            "queue_limit": 1,
            "log_distance": {"reference_loss_db": 40.0},
            "reception": {"model": "threshold", "min_sinr_db": 6.0, "preamble_sinr_db": 6.0},
            "access": {"method": "csma-802154", "acknowledged": False},
            "measures": {"range": {"noise_m": 0.002}},
        },
        "messages that overlap are lost; carrier sense is that of IEEE 802.15.4, which gives up after 5 tries, where "
        "Kilobots keep trying; strength does not fall with distance, and its dBm have no meaning",
    ),
    "acoustic": Preset(
        "a small acoustic modem in the sea: 24 to 32 kHz, 640 bit/s, 168 dB re 1 uPa at 1 m (27.2 dBm), 1500 m/s",
        "Newcastle University, nanomodem v3 (USMART, 2018; Sherlock et al., Electronics 11, 2022: right from -4.5 dB); "
        "absorption: Thorp; noise: Coates, in M. Stojanovic, ACM MC2R 11, 2007",
        {
            "model": "log-distance",
            "frequency_hz": 28e3,
            "propagation_mps": 1500.0,
            "bit_rate_bps": 640,
            "overhead_bytes": 24,  # 64 bytes then take 1.1 s, the 463 bit/s of the data sheet
            "max_payload_bytes": 64,
            "log_distance": {"exponent": 2.0, "reference_loss_db": 0.0, "absorption_db_per_m": 0.0074},
            "antenna": {"power_dbm": 27.2},
            "noise": {"bandwidth_hz": 8e3, "figure_db": 70.8},  # 37.6 dB re 1 uPa in 1 Hz
            "reception": {"model": "threshold", "min_sinr_db": -4.5, "preamble_sinr_db": -4.5},
            "access": {"method": "aloha"},
        },
        "spherical spreading with absorption and the noise of 5 m/s of wind, without echoes, layers and Doppler shift; "
        "of two frames as strong the first survives, other frames being noise to it; which overlap is decided by when "
        "they were sent, at any distance: only receptions are late",
    ),
}


PATH_LOSS = ("log_distance", "two_ray", "itu_indoor")
PRESETS: dict[str, Preset] = {**DISKS, **STANDARDS, **SIMULATORS, **OTHER_MEDIA}


def with_preset(radio: Mapping[str, Any]) -> dict[str, Any]:
    """Return the radio's table with the values of its preset, if it names one that exists, for keys left out."""
    name = radio.get("preset")
    preset = PRESETS.get(name) if isinstance(name, str) else None
    if preset is None:
        return dict(radio)
    values = dict(preset.radio)
    if radio.get("model", values["model"]) != values["model"]:  # the preset's path loss is that of its model
        values = {key: value for key, value in values.items() if key not in PATH_LOSS}
    return _filled(radio, values)


def _filled(table: Mapping[str, Any], defaults: Mapping[str, Any]) -> dict[str, Any]:
    filled = deepcopy(dict(table))
    for key, value in defaults.items():
        if isinstance(value, dict) and isinstance(filled.get(key), dict):
            filled[key] = _filled(cast("dict[str, Any]", filled[key]), cast("dict[str, Any]", value))
        else:
            filled.setdefault(key, deepcopy(cast(object, value)))
    return filled

"""Radios by robot: the table of docs/radio-presets.md, and how many robots share a channel, which it measures.

`python -m docs.robot_radios [PRESET ...]` measures presets, all without a name; a table of `docs.reference` shows them.
"""

import csv
import sys
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.radio.analysis.contention import contention
from swarmwire.comms.radio.config.frames import airtime_ns
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.phy.propagation import range_of
from swarmwire.deploy.runs.scenario_parts import radio_of

MEASURED = Path(__file__).with_name("robot_radios.csv")
MESSAGE_BYTES, INTERVAL_S, DELIVERY = 50, 0.1, 0.9
SEEDS, MOST = range(1, 4), 512  # robots
TOO_MANY = f"more than {MOST}"
NOTHING = ""  # a unit disk takes next to no time; shown as a dash


class RobotRadio(NamedTuple):
    """A robot with a preset that suits its radio, and what to know about it."""

    robot: str
    preset: str
    limits: str


ROBOTS = (
    RobotRadio("foot-bot, range and bearing", "argos-rab", "line of sight; 10 bytes; no collisions"),
    RobotRadio("e-puck, range and bearing", "infrared-epuck", "line of sight; 4 bytes; no collisions"),
    RobotRadio("e-puck2, ESP32", "wifi-n-2G", "2.4 GHz at 20 MHz; broadcasts at 6 Mbit/s"),
    RobotRadio("Kilobot", "kilobot", "9 bytes beside the tag; neighbours within 0.1 m"),
    RobotRadio("Crazyflie", "crazyradio-2M", "32 bytes; a station polls, drones only answer"),
    RobotRadio("TurtleBot, Raspberry Pi", "wifi-n-5G", '`rate_control = "ideal"` adapts the rate to distance'),
    RobotRadio("old Wi-Fi, ad hoc", "wifi-b-1M", "long range at 1 Mbit/s; few robots fill the channel"),
    RobotRadio("field rover", "lora-eu868", "1 % of the time on air, a message per 10 s; sent without listening"),
    RobotRadio("sensor node, XBee", "ieee802154", "116 bytes; CSMA/CA gives up after five tries"),
    RobotRadio("beacon, Bluetooth LE", "ble-1M", "27 bytes; sent without listening"),
    RobotRadio("underwater vehicle", "acoustic", "sound, 1500 m/s; a message per second"),
)
HEAD = ("robot", "preset", "range", "bit rate", "50 bytes on air", "robots at 10 Hz", "limits")


def rows() -> list[tuple[str, ...]]:
    """Rows below `HEAD`: range by path loss alone; the time on air of all frames that a message of 50 bytes needs."""
    measured = _measured()
    return [
        (each.robot, f"`{each.preset}`", *_figures(radio_of(each.preset, [])), measured[each.preset], each.limits)
        for each in ROBOTS
    ]


def _figures(radio: Radio) -> tuple[str, str, str]:
    if not radio.is_phy:
        return f"{_rounded(range_of(radio))} m", NOTHING, NOTHING
    quotient, remainder = divmod(MESSAGE_BYTES, radio.max_payload_bytes)
    sizes = np.array([radio.max_payload_bytes] * quotient + [remainder] * (remainder > 0))
    on_air_ms = float(airtime_ns(radio, radio.overhead_bytes + sizes).sum()) / 1e6
    frames = f" in {len(sizes)} frames" if len(sizes) > 1 else ""
    return f"{_rounded(range_of(radio))} m", _bit_rate(radio), f"{_rounded(on_air_ms)} ms{frames}"


def _bit_rate(radio: Radio) -> str:
    lora, bps = radio.lora_or_none, float(radio.bit_rate_bps)
    if lora is not None:
        coding = float(Fraction(lora.coding_rate))
        bps = lora.spreading_factor * coding * NS_PER_S / lora.symbol_ns
    return f"{bps / 1e6:g} Mbit/s" if bps >= 1e6 else f"{bps / 1e3:.3g} kbit/s"


def _rounded(number: float | None) -> str:
    return NOTHING if number is None else f"{float(f'{number:.2g}'):g}"


def robots_at_10_hz(radio: Radio) -> str:
    """How many robots in one spot may broadcast 50 bytes, or the longest payload, at 10 Hz, 0.9 of which are received.

    To 4 %; "0" if not even one has the time; "" for a unit disk, where nobody disturbs others, and where stations
    poll.
    """
    if not radio.is_phy or radio.access_or_default.method == "esb":
        return NOTHING
    payload_bytes = min(MESSAGE_BYTES, radio.max_payload_bytes)
    airtime_s = float(airtime_ns(radio, np.array([radio.overhead_bytes + payload_bytes]))[0]) / NS_PER_S
    duty_cycle = (radio.lora_or_none and radio.lora_or_none.duty_cycle) or 1.0
    if airtime_s > duty_cycle * INTERVAL_S:
        return "0"

    def suffices(robots: int) -> bool:
        return contention(radio, robots, payload_bytes, INTERVAL_S, SEEDS).pdr >= DELIVERY

    if suffices(MOST):
        return TOO_MANY
    low, high = 1, MOST
    while high - low > max(1, low // 25):
        middle = (low + high) // 2
        low, high = (middle, high) if suffices(middle) else (low, middle)
    return str(low)


def _measured() -> dict[str, str]:
    with MEASURED.open(encoding="utf-8", newline="") as file:
        return {row["preset"]: row["robots"] for row in csv.DictReader(file)}


def main(presets: Sequence[str]) -> int:
    """Measure these presets, and keep the figures of the others."""
    names = list(dict.fromkeys(each.preset for each in ROBOTS))
    measured = _measured() if MEASURED.exists() else {}
    for name in presets or names:
        measured[name] = robots_at_10_hz(radio_of(name, []))
        sys.stdout.write(f"{name}: {measured[name]}\n")
    lines = [f"{name},{measured[name]}\n" for name in names if name in measured]
    MEASURED.write_text("preset,robots\n" + "".join(lines), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""The e-puck2's packets, streams, wheels and units, each way and back, against its fact sheet."""

from itertools import accumulate

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.protocols.epuck2 import packets, readings
from swarmwire.comms.protocols.epuck2.packets import (
    ALL_DARK,
    MAX_STEPS_PER_S,
    SENSORS,
    Answers,
    Lights,
    PacketRequest,
    RobotCommand,
    RobotSettingsBits,
    body_speeds,
    wheel_steps,
)
from swarmwire.comms.protocols.epuck2.readings import Odometer
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.comms.robot.sensors.scan import ScanSpec
from tests.support.robots import epuck2

WHEEL_BASE_M = 0.053
STEPS = st.integers(-32768, 32767)
COMMANDS = st.builds(
    RobotCommand,
    STEPS,
    STEPS,
    st.builds(Lights, st.integers(0, 63), st.binary(min_size=12, max_size=12)),
    st.sampled_from([PacketRequest(bits) for bits in range(4)]),
    st.sampled_from([RobotSettingsBits(bits) for bits in range(8)]),
    st.integers(0, 63),
)
SHARES = st.floats(0.0, 1.0)
BODY = load_body("epuck2")


@given(command=COMMANDS)
def test_command_survives_encoding(command: RobotCommand) -> None:
    assert RobotCommand.decoded(command.encoded()) == command


@given(command=COMMANDS)
def test_command_layout_is_that_of_the_fact_sheet(command: RobotCommand) -> None:
    values = epuck2.read(epuck2.COMMAND, command.encoded())
    assert (values["id"], values["request"], values["settings"]) == (0x80, command.request, command.settings)
    assert (values["left"], values["right"], values["sound"]) == (command.left, command.right, command.sound)
    assert values["leds"] == command.lights.switched
    assert values["led2"] + values["led4"] + values["led6"] + values["led8"] == tuple(command.lights.colours)


def test_sensor_layout_is_that_of_the_fact_sheet() -> None:
    assert SENSORS.fields is not None
    ours = [(field[1], field[0].itemsize, field[0].base.str[1:]) for field in SENSORS.fields.values()]
    kinds = {"b": "i1", "B": "u1", "h": "i2", "H": "u2", "f": "f4"}
    theirs = [
        (offset, int(form[1:-1] or 1) * int(kinds[form[-1]][1]), kinds[form[-1]])
        for offset, form in epuck2.SENSORS.values()
    ]
    assert ours == theirs
    assert SENSORS.itemsize == 104


@given(headers=st.lists(st.sampled_from([1, 2, 3]), max_size=4), cuts=st.lists(st.integers(0, 80_000)))
def test_answers_are_read_in_any_pieces(headers: list[int], cuts: list[int]) -> None:
    sizes = {1: 38400, 2: 104, 3: 0}
    sent = b"".join(bytes([header]) + bytes([7]) * sizes[header] for header in headers)
    stream = Answers()
    read = [answer for piece in cut(sent, cuts) for answer in stream.fed(piece)]
    assert [(answer.header, len(answer.payload)) for answer in read] == [(header, sizes[header]) for header in headers]


@pytest.mark.parametrize("first", [0, 4, 0x80, 255])
def test_answer_with_an_unknown_header_is_garbage(first: int) -> None:
    with pytest.raises(BadFrame, match="garbage"):
        list(Answers().fed(b"\x03" + bytes([first])))


@given(linear_mps=st.floats(-1.0, 1.0), angular_radps=st.floats(-50.0, 50.0))
def test_wheel_speeds_are_limited_and_keep_the_curve(linear_mps: float, angular_radps: float) -> None:
    left, right = wheel_steps(linear_mps, angular_radps, WHEEL_BASE_M)
    assert max(abs(left), abs(right)) <= MAX_STEPS_PER_S
    linear, angular = body_speeds(left, right, WHEEL_BASE_M)
    share = max(abs(linear_mps) + abs(angular_radps) * WHEEL_BASE_M / 2, 1e-9) / (MAX_STEPS_PER_S * np.pi * 0.04 / 1000)
    slower = 1.0 / max(share, 1.0)
    assert linear == pytest.approx(linear_mps * slower, abs=1e-4)
    assert angular == pytest.approx(angular_radps * slower, abs=5e-3)


DARK = dict.fromkeys(range(10), 0)


@given(which=st.sampled_from([1, 3, 5, 7]), rgb=st.integers(0, 0xFFFFFF))
def test_led_colour_survives_within_a_hundredth(which: int, rgb: int) -> None:
    shown = ALL_DARK.with_changed({which: rgb}).shown(DARK)
    for shift in (0, 8, 16):
        assert abs((shown[which] >> shift & 0xFF) - (rgb >> shift & 0xFF)) <= 255 / 200 + 0.5
    assert not any(colour for led, colour in shown.items() if led != which)


def test_led_of_one_colour_lights_from_half_intensity() -> None:
    ring = {0: 0x800000, 2: 0x7FFFFF, 4: 0xFFFFFF, 6: 0x00FF00}
    shown = ALL_DARK.with_changed(ring | {8: 0xFF0000, 9: 0x008000}).shown(DARK)
    assert [shown[led] for led in (0, 2, 4, 6, 8, 9)] == [0xFF0000, 0, 0xFF0000, 0, 0xFF0000, 0x00FF00]
    assert ALL_DARK.with_changed({8: 0x00FFFF, 9: 0xFF7FFF}).switched == 0
    with pytest.raises(ValueError, match="0 to 9"):
        ALL_DARK.with_changed({10: 0xFF0000})


@given(start=STEPS, steps=st.lists(st.tuples(st.integers(-32768, 32767), st.integers(-32768, 32767)), max_size=30))
def test_odometer_counts_across_counter_wraps(start: int, steps: list[tuple[int, int]]) -> None:
    odometer = Odometer()
    odometer.update(start, start)
    for left, right in accumulate(steps, lambda before, more: (before[0] + more[0], before[1] + more[1])):
        odometer.update(wrapped(start + left), wrapped(start + right))
        assert (odometer.left, odometer.right) == (left, right)


@pytest.mark.parametrize(("steps", "elapsed_s", "goes_on"), [(900, 1.0, True), (2000, 1.0, False), (100, 60.0, False)])
def test_odometer_resumes_after_a_pause_only_within_reach(steps: int, elapsed_s: float, goes_on: bool) -> None:
    odometer = Odometer()
    odometer.update(0, 0)
    odometer.update(500, 500)
    assert odometer.resume(wrapped(500 + steps), 500, elapsed_s) is goes_on
    assert (odometer.left, odometer.right) == (500 + steps * goes_on, 500)


def wrapped(steps: int) -> int:
    return (steps + 32768) % 65536 - 32768


def cut(sent: bytes, cuts: list[int]) -> list[bytes]:
    ends = sorted({min(at, len(sent)) for at in cuts} | {len(sent)})
    return [sent[start:end] for start, end in zip([0, *ends], ends, strict=False)]


def tof() -> ScanSpec:
    assert BODY.scan is not None
    return BODY.scan


@given(st.lists(SHARES, min_size=1, max_size=8).map(np.array))
def test_sensor_shares_survive_within_half_a_step(value) -> None:
    black, white = readings.GROUND_BLACK, readings.GROUND_WHITE
    for got, steps in (
        (readings.proximity(readings.to_proximity(value)), readings.PROXIMITY_FULL),
        (readings.light(readings.to_light(value)), readings.AMBIENT_DARK),
        (readings.shade(readings.to_shade(value), black, white), white - black),
    ):
        assert np.abs(got - value).max() <= 0.5 / steps + 1e-12


@given(st.floats(0.05, 1.99))
def test_distance_survives_within_half_a_millimetre_and_nothing_is_infinite(range_m) -> None:
    raw = readings.to_distance(np.array([range_m, np.inf]), tof())
    values = readings.distance_m(raw, tof())
    assert abs(float(values[0]) - range_m) <= 0.0005 + 1e-12
    assert (raw[1], values[1]) == (readings.SEES_NOTHING_MM, np.inf)


@pytest.mark.parametrize(
    ("encode", "values", "raw"),
    [
        (readings.to_light, [0.0, 0.5, 1.0], [4000.0, 2000.0, 0.0]),  # most in the dark
        (readings.to_acceleration, [9.80665, -9.80665, 100.0], [800.0, -800.0, 1536.0]),  # 800 per g, up to a limit
        (readings.to_turn, np.deg2rad([62.5, -62.5, 600.0]), [8192.0, -8192.0, 32767.0]),  # full at 250 degrees/s
        (readings.to_voltage, [4.2, 3.4], [round(4.2 * 819.2), round(3.4 * 819.2)]),  # driver: raw / (4096 x 0.6 / 3.0)
    ],
)
def test_sensor_values_read_as_in_the_fact_sheet_and_driver(encode, values, raw) -> None:
    assert encode(np.array(values)).tolist() == raw


def test_packet_headers_have_fixed_payload_sizes() -> None:
    assert packets.PORT == 1000
    assert {int(header): packets.PAYLOAD_BYTES[header] for header in packets.Header} == {1: 38400, 2: 104, 3: 0}

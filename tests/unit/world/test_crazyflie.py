"""Emulated Crazyflies: packets by Bitcraze's documentation, and flight, without threads or sockets."""

import struct
from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.protocols.crazyflie import check_fits
from swarmwire.comms.robot.bodies.body import body_from, load_body
from swarmwire.world.gateways.crazyflie.flight import STANDSTILL, SupervisorState, unpacked_attitude
from swarmwire.world.gateways.crazyflie.gateway import addresses_of
from swarmwire.world.gateways.crazyflie.robot import EmulatedCrazyflie
from swarmwire.world.gateways.crazyflie.trajectories import compressed_pieces_of

TICK_MS = 50
HOVER = struct.pack("<Bffff", 10, 0.2, 0.1, 30.0, 0.5)  # m/s, m/s, degrees/s, m


class Flight:
    """A robot and its time; its readings follow the commands."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.has_client = True
        self.robot, self.now_ms = EmulatedCrazyflie(load_body("crazyflie"), self.counts), 0

    def send(self, port: int, channel: int, data: bytes) -> bytes:
        """The data of the answer, with the header of the request."""
        header = bytes([port << 4 | 0x0C | channel])
        answer = self.robot.receive(header + data)
        assert answer is None or answer[:1] == header
        return answer[1:] if answer else b""

    def pass_ms(self, passed_ms: int, **row: FloatArray) -> list[bytes]:
        """Let time pass, and return the sent packets. The client, if any, pings like cflib."""
        sent: list[bytes] = []
        for _ in range(passed_ms // TICK_MS):
            self.now_ms += TICK_MS
            if self.has_client:
                self.send(15, 0, b"ping")
            named = {name.replace("__", "."): value for name, value in row.items()}
            sent += self.robot.sense(self.now_ms * 1_000_000, named)
            self.robot.fly()
        return sent

    def hover(self, passed_ms: int) -> None:
        """Repeat the setpoint."""
        for _ in range(passed_ms // TICK_MS):
            self.send(7, 0, HOVER)
            self.pass_ms(TICK_MS)


def items(flight: Flight, port: int) -> dict[str, tuple[int, int]]:
    """The table of contents: number and type of each name."""
    count, _ = struct.unpack_from("<HI", flight.send(port, 0, b"\3"), 1)
    entries: dict[str, tuple[int, int]] = {}
    for number in range(count):
        answer = flight.send(port, 0, struct.pack("<BH", 2, number))
        group, name, after = answer[4:].split(b"\0")
        assert answer[:3] == struct.pack("<BH", 2, number)
        assert after == b""
        assert len(answer) <= 30
        entries[f"{group.decode()}.{name.decode()}"] = number, answer[3]
    assert flight.send(port, 0, struct.pack("<BH", 2, count)) == b"\2"
    return entries


def test_crazyflie_answers_with_bitcrazes_greeting_protocol_and_tables() -> None:
    flight = Flight()
    assert flight.send(15, 1, b"\0") == b"Bitcraze Crazyflie".ljust(30, b"\0")
    assert flight.send(13, 1, b"\0") == b"\0\x0c\0\0\0"
    assert flight.send(15, 0, b"echo") == b"echo"
    assert flight.robot.receive(b"\xff") == b"\xff"  # the null packet of a scan
    params, logs = flight.send(2, 0, b"\3"), flight.send(5, 0, b"\3")
    assert params == Flight().send(2, 0, b"\3")
    assert params[3:7] != logs[3:7]  # checksums, by which clients keep tables


def test_crazyflie_parameter_is_read_and_written_by_its_number() -> None:
    flight = Flight()
    number, kind = items(flight, 2)["ring.solidRed"]
    assert kind == 0x08
    assert flight.send(2, 2, struct.pack("<HB", number, 77)) == struct.pack("<HB", number, 77)
    assert flight.send(2, 1, struct.pack("<H", number)) == struct.pack("<HBB", number, 0, 77)
    assert flight.send(2, 3, b"\0ring\0solidRed\0\x08\x05") == b"\0ring\0solidRed\0\0"
    assert flight.send(2, 1, struct.pack("<H", number))[3] == 5
    deck, kind = items(flight, 2)["deck.bcFlow2"]
    assert kind == 0x48  # read only, and installed
    assert flight.send(2, 2, struct.pack("<HB", deck, 0)) == struct.pack("<HB", deck, 1)


def test_led_ring_shows_its_solid_or_fade_colour() -> None:
    flight = Flight()

    def set_parameter(name: str, form: str, value: int) -> None:
        number = items(flight, 2)[f"ring.{name}"][0]
        flight.send(2, 2, struct.pack(f"<H{form}", number, value))

    for name, value in (("solidRed", 100), ("solidGreen", 0), ("solidBlue", 1), ("effect", 7)):
        set_parameter(name, "B", value)
    assert flight.robot.colour == 0x640001
    set_parameter("fadeColor", "I", 0x00A000)
    set_parameter("effect", "B", 14)
    assert flight.robot.colour == 0x00A000
    set_parameter("effect", "B", 0)
    assert flight.robot.colour == 0
    assert flight.counts == {}
    set_parameter("effect", "B", 3)
    assert flight.counts == {"ring_effects_not_shown": 1}


def test_log_block_is_sent_at_its_period_until_it_is_stopped() -> None:
    flight = Flight()
    table = items(flight, 5)
    front, volts = table["range.front"][0], table["pm.vbat"][0]
    assert flight.send(5, 1, struct.pack("<BBBHBH", 6, 1, 0x22, front, 0x77, volts)) == b"\6\1\0"
    assert flight.send(5, 1, struct.pack("<BBBH", 6, 1, 0x22, front)) == b"\6\1\x11"  # exists already
    assert flight.send(5, 1, b"\3\1\x0a") == b"\3\1\0"  # each 100 ms
    ranges = np.array([1.234, np.inf, 0.5, 2.0])
    sent = flight.pass_ms(1000, scan__range_m=ranges, battery__voltage_v=np.array(3.75))
    assert len(sent) == 10
    assert sent[-1][:2] == b"\x5e\1"
    assert int.from_bytes(sent[-1][2:5], "little") == 1000
    assert struct.unpack("<Hf", sent[-1][5:]) == (1234, 3.75)
    assert flight.send(5, 1, b"\4\1") == b"\4\1\0"
    assert flight.pass_ms(500) == []
    assert flight.send(5, 1, b"\2\1") == b"\2\1\0"
    assert flight.send(5, 1, b"\2\1") == b"\2\1\2"  # no such block
    too_large = struct.pack("<BH", 0x77, volts) * 7
    assert flight.send(5, 1, b"\6\1" + too_large) == b"\6\1\7"


def test_log_blocks_are_forgotten_a_second_after_the_last_packet() -> None:
    # log.c: a block that is due without a connection deletes all; RADIO_ACTIVITY_TIMEOUT_MS is 1000.
    flight = Flight()
    front = items(flight, 5)["range.front"][0]
    for number in (1, 2):
        assert flight.send(5, 1, struct.pack("<BBBH", 6, number, 0x22, front)) == bytes([6, number, 0])
    flight.send(5, 1, b"\3\1\x0a")  # each 100 ms
    flight.pass_ms(500)
    flight.has_client = False
    assert len(flight.pass_ms(5000)) == 9  # at 600 to 1400 ms
    flight.has_client = True
    assert flight.pass_ms(1000) == []  # none for the next client
    assert flight.send(5, 1, struct.pack("<BBBH", 6, 2, 0x22, front)) == b"\6\2\0"


def test_parameters_and_trajectories_outlive_their_client() -> None:
    flight = Flight()  # the firmware forgets log blocks only
    flight.send(2, 3, b"\0ring\0solidRed\0\x08\x05")
    upload(flight, straight_piece(1.0))
    define(flight, 1, 0)
    flight.has_client = False
    flight.pass_ms(3000)
    flight.has_client = True
    assert flight.send(2, 1, struct.pack("<H", items(flight, 2)["ring.solidRed"][0]))[3] == 5
    assert start(flight, 1) == 0


def test_crazyflie_without_setpoints_levels_out_then_locks() -> None:
    flight = Flight()
    flight.hover(3000)
    flight.pass_ms(400)
    assert flight.robot.flight.motion != STANDSTILL
    flight.pass_ms(150)
    assert (flight.robot.flight.state, flight.robot.flight.motion) == (SupervisorState.LEVEL_OUT, STANDSTILL)
    assert flight.robot.flight.height_m == pytest.approx(0.5, abs=0.01)
    sent = flight.pass_ms(2500)
    assert flight.robot.flight.state is SupervisorState.LOCKED
    assert flight.robot.flight.height_m == 0.0
    assert [datagram[1:] for datagram in sent if datagram[0] == 0x0C] == [b"SUP: Locked, reboot required\n"]
    flight.hover(1000)
    assert flight.robot.flight.height_m == 0.0


def test_stop_with_notify_setpoints_stop_does_not_lock() -> None:
    flight = Flight()
    flight.hover(2000)
    flight.send(7, 0, b"\0")
    flight.send(7, 1, b"\0" + bytes(4))
    flight.pass_ms(4000)
    assert flight.robot.flight.state is SupervisorState.READY
    flight.hover(2000)
    assert flight.robot.flight.height_m > 0.4


@pytest.mark.parametrize(("port", "channel", "data"), [(9, 1, b"\3"), (6, 1, b"\3")])
def test_emergency_stop_locks_the_crazyflie_at_once(port: int, channel: int, data: bytes) -> None:
    flight = Flight()
    flight.hover(2000)
    flight.send(port, channel, data)
    flight.send(7, 0, HOVER)
    flight.pass_ms(TICK_MS)
    assert (flight.robot.flight.state, flight.robot.flight.motion) == (SupervisorState.LOCKED, STANDSTILL)
    assert int.from_bytes(supervisor(flight), "little") >> 6 & 1


def supervisor(flight: Flight) -> bytes:
    """The state's bits."""
    answer = flight.robot.receive(b"\x9c\x0c")
    assert answer is not None
    assert answer[:2] == b"\x9c\x8c"
    return answer[2:]


def straight_piece(x_m: float, duration_s: float = 1.0) -> bytes:
    """A piece from (0, 0, 0.5) to (x, 0, 0.5) at constant speed."""
    axes = [0.0, x_m / duration_s, *[0.0] * 6, *[0.0] * 8, 0.5, *[0.0] * 7, *[0.0] * 8]
    return struct.pack("<33f", *axes, duration_s)


def compressed_trajectory(*pieces: bytes) -> bytes:
    """A trajectory from (0, 0, 0.5) with a last piece without duration."""
    return struct.pack("<4h", 0, 0, 500, 0) + b"".join(pieces) + bytes(3)


def upload(flight: Flight, data: bytes, offset: int = 0) -> None:
    """Write to the memory of trajectories."""
    for at in range(0, len(data), 24):
        assert flight.send(4, 2, struct.pack("<BI", 0, offset + at) + data[at : at + 24])[5] == 0


def define(flight: Flight, number: int, kind: int, offset: int = 0, pieces: int = 1) -> int:
    """The result of a definition."""
    return flight.send(8, 0, struct.pack("<BBBBIB", 6, number, 1, kind, offset, pieces))[3]


def start(flight: Flight, number: int, *, flags: tuple[int, int, int] = (0, 0, 0), stretch: float = 1.0) -> int:
    """The result of a start; `flags`: relative place, relative yaw, reversed."""
    return flight.send(8, 0, struct.pack("<BBBBBBf", 13, 0, *flags, number, stretch))[3]


def test_trajectories_follow_the_newest_definition_and_memory() -> None:
    # crtp_commander_high_level.c: `define_trajectory` overwrites always, `start_trajectory2` reads the memory.
    flight, at_m = Flight(), []
    upload(flight, straight_piece(1.0))
    define(flight, 1, 0)
    for data, kind in (
        (straight_piece(1.0), None),
        (straight_piece(-1.0), None),
        (compressed_trajectory(b"\1" + struct.pack("<Hh", 1000, -700)), 1),
    ):
        upload(flight, data)
        if kind is not None:
            assert define(flight, 1, kind) == 0
        assert start(flight, 1) == 0
        flight.pass_ms(6000)
        at_m.append(flight.robot.flight.estimate.x_m)
    assert at_m == pytest.approx([1.0, -1.0, -0.7], abs=0.02)


def test_trajectories_that_the_memory_does_not_hold_are_refused() -> None:
    flight = Flight()
    assert define(flight, 1, 0, pieces=3) == 0  # the firmware takes every definition
    upload(flight, straight_piece(1.0))
    assert start(flight, 1) == 8  # the second piece has no duration
    define(flight, 1, 1, offset=4090)
    assert start(flight, 1) == 8
    define(flight, 1, 2)  # no type of the firmware
    assert start(flight, 1) == 8
    flight.pass_ms(1000)
    assert flight.robot.flight.state is SupervisorState.READY
    assert flight.counts["plans_refused"] == 3
    assert define(flight, 31, 0) == 8  # NUM_TRAJECTORY_DEFINITIONS


def test_compressed_trajectories_are_bezier_curves_in_mm() -> None:
    # x: linear to 0.4 m; y: cubic with 0, 0.1, 0.3, 0.2 m; z: constant; yaw: seventh degree, 0 to 90 degrees.
    x_y, z_yaw = struct.pack("<4h", 400, 100, 300, 200), struct.pack("<7h", 0, 0, 0, 900, 900, 900, 900)
    pieces = b"\xc9" + struct.pack("<H", 2000) + x_y + z_yaw, b"\1" + struct.pack("<Hh", 500, 1400)
    first, second = compressed_pieces_of(b"--" + compressed_trajectory(*pieces), 2) or []
    half = first.at(1.0)  # Bernstein: (p0 + 3 p1 + 3 p2 + p3) / 8, and 35 + 21 + 7 + 1 of 128 of 90 degrees
    assert half.pose == pytest.approx([0.2, (0.3 + 0.9 + 0.2) / 8, 0.5, np.pi / 4])
    assert half.velocity[:3] == pytest.approx([0.2, 3.0 * (0.2 + 0.3 - 0.1) / 4 / 2.0, 0.0])
    assert second.at(0.0).pose == pytest.approx(first.at(2.0).pose)
    assert second.at(0.5).pose == pytest.approx([1.4, 0.2, 0.5, np.pi / 2])
    assert compressed_pieces_of(compressed_trajectory(*pieces)[:-3], 0) is None  # without an end


@pytest.mark.parametrize(("flags", "stretch"), [((0, 0, 1), 1.0), ((0, 0, 0), 2.0)])
def test_compressed_trajectories_are_refused_reversed_and_stretched(flags: tuple[int, int, int], stretch: float):
    flight = Flight()  # ENOEXEC, as in the firmware
    upload(flight, compressed_trajectory(b"\1" + struct.pack("<Hh", 1000, 500)))
    define(flight, 1, 1)
    assert start(flight, 1, flags=flags, stretch=stretch) == 8
    assert start(flight, 1) == 0


def test_trajectory_relative_to_the_yaw_is_turned() -> None:
    flight = Flight()
    flight.send(6, 1, struct.pack("<B7f", 8, 1.0, 2.0, 0.0, 0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)))  # yaw 90 degrees
    flight.send(8, 0, struct.pack("<BBff?f", 7, 0, 0.6, 0.0, True, 2.0))
    flight.pass_ms(2500)
    upload(flight, straight_piece(1.0))
    define(flight, 1, 0)
    assert start(flight, 1, flags=(1, 1, 0)) == 0
    flight.pass_ms(5000)
    estimate = flight.robot.flight.estimate
    assert (estimate.x_m, estimate.y_m, estimate.yaw_rad) == pytest.approx((1.0, 3.0, np.pi / 2), abs=0.02)


def test_packed_attitude_is_unpacked() -> None:
    half = round(0x1FF * np.sin(0.3) * np.sqrt(2.0))  # a turn by 0.6 rad about z: w is the largest
    assert unpacked_attitude(3 << 30 | half) == pytest.approx((0.0, 0.0, np.sin(0.3), np.cos(0.3)), abs=2e-3)


@given(datagram=st.binary(max_size=40))
def test_crazyflie_survives_any_datagram(datagram: bytes) -> None:
    flight = Flight()
    flight.robot.receive(datagram)
    flight.pass_ms(100)
    assert np.isfinite(flight.robot.flight.height_m)


def test_body_unlike_a_crazyflie_is_refused() -> None:
    with pytest.raises(BadInput, match="epuck2: drive.kind"):
        check_fits(load_body("epuck2"))
    rays = {"rays": 5, "range_m": 4.0}
    with pytest.raises(BadInput, match=r"sensors\.scan"):
        check_fits(body_from({"like": "crazyflie", "sensors": {"scan": rays}}, "many.toml"))


@pytest.mark.parametrize("address", ["127.0.0.1", "127.0.0.1:x", ":1", "127.0.0.1:65535"])
def test_crazyflie_address_without_enough_ports_is_refused(address: str) -> None:
    with pytest.raises(BadInput, match="gateway crazyflie: address"):
        addresses_of(address, 2)

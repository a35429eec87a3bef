"""Emulated Crazyflies: packets as Bitcraze's documentation writes them, and how they fly. No thread, no socket."""

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
from swarmwire.world.gateways.crazyflie.trajectories import TrajectoryPoint, compressed_pieces_of, piece_between

TICK_MS = 50
HOVER = struct.pack("<Bffff", 10, 0.2, 0.1, 30.0, 0.5)  # m/s, m/s, degrees/s, m


class Flown:
    """A robot and its time; by its readings it goes to the commanded place."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.has_client = True
        self.robot, self.now_ms = EmulatedCrazyflie(load_body("crazyflie"), self.counts), 0

    def send(self, port: int, channel: int, data: bytes) -> bytes:
        """The data of the answer, whose header must be that of the request."""
        header = bytes([port << 4 | 0x0C | channel])
        answer = self.robot.receive(header + data)
        assert answer is None or answer[:1] == header
        return answer[1:] if answer else b""

    def pass_ms(self, passed_ms: int, **row: FloatArray) -> list[bytes]:
        """Let time pass; what was sent. As cflib does, the client pings all the while, if there is one."""
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
        """Repeat the set-point for so long."""
        for _ in range(passed_ms // TICK_MS):
            self.send(7, 0, HOVER)
            self.pass_ms(TICK_MS)


def items(flown: Flown, port: int) -> dict[str, tuple[int, int]]:
    """The table of contents: number and type of each name."""
    count, _ = struct.unpack_from("<HI", flown.send(port, 0, b"\3"), 1)
    found: dict[str, tuple[int, int]] = {}
    for number in range(count):
        answer = flown.send(port, 0, struct.pack("<BH", 2, number))
        group, name, rest = answer[4:].split(b"\0")
        assert answer[:3] == struct.pack("<BH", 2, number)
        assert rest == b""
        assert len(answer) <= 30
        found[f"{group.decode()}.{name.decode()}"] = number, answer[3]
    assert flown.send(port, 0, struct.pack("<BH", 2, count)) == b"\2"
    return found


def test_it_greets_as_bitcrazes_firmware_and_tells_its_protocol() -> None:
    flown = Flown()
    assert flown.send(15, 1, b"\0") == b"Bitcraze Crazyflie".ljust(30, b"\0")
    assert flown.send(13, 1, b"\0") == b"\0\x0c\0\0\0"
    assert flown.send(15, 0, b"echo") == b"echo"
    assert flown.robot.receive(b"\xff") == b"\xff"  # the null packet of a scan


def test_a_parameter_is_read_and_written_by_its_number() -> None:
    flown = Flown()
    number, kind = items(flown, 2)["ring.solidRed"]
    assert kind == 0x08
    assert flown.send(2, 2, struct.pack("<HB", number, 77)) == struct.pack("<HB", number, 77)
    assert flown.send(2, 1, struct.pack("<H", number)) == struct.pack("<HBB", number, 0, 77)
    assert flown.send(2, 3, b"\0ring\0solidRed\0\x08\x05") == b"\0ring\0solidRed\0\0"
    assert flown.send(2, 1, struct.pack("<H", number))[3] == 5
    deck, kind = items(flown, 2)["deck.bcFlow2"]
    assert kind == 0x48  # read only, and there
    assert flown.send(2, 2, struct.pack("<HB", deck, 0)) == struct.pack("<HB", deck, 1)


def test_the_ring_shows_its_solid_colour_or_the_one_to_which_it_fades() -> None:
    flown = Flown()

    def put(name: str, form: str, value: int) -> None:
        number = items(flown, 2)[f"ring.{name}"][0]
        flown.send(2, 2, struct.pack(f"<H{form}", number, value))

    for name, value in (("solidRed", 100), ("solidGreen", 0), ("solidBlue", 1), ("effect", 7)):
        put(name, "B", value)
    assert flown.robot.colour == 0x640001
    put("fadeColor", "I", 0x00A000)
    put("effect", "B", 14)
    assert flown.robot.colour == 0x00A000
    put("effect", "B", 0)
    assert flown.robot.colour == 0
    assert flown.counts == {}
    put("effect", "B", 3)
    assert flown.counts == {"ring_effects_not_shown": 1}


def test_tables_have_a_checksum_that_caches_can_rely_on() -> None:
    params, logs = Flown().send(2, 0, b"\3"), Flown().send(5, 0, b"\3")
    assert params == Flown().send(2, 0, b"\3")
    assert params[3:7] != logs[3:7]


def test_a_log_block_comes_at_its_period_until_it_is_stopped() -> None:
    flown = Flown()
    table = items(flown, 5)
    front, volts = table["range.front"][0], table["pm.vbat"][0]
    assert flown.send(5, 1, struct.pack("<BBBHBH", 6, 1, 0x22, front, 0x77, volts)) == b"\6\1\0"
    assert flown.send(5, 1, struct.pack("<BBBH", 6, 1, 0x22, front)) == b"\6\1\x11"  # it is there already
    assert flown.send(5, 1, b"\3\1\x0a") == b"\3\1\0"  # each 100 ms
    ranges = np.array([1.234, np.inf, 0.5, 2.0])
    sent = flown.pass_ms(1000, scan__range_m=ranges, battery__voltage_v=np.array(3.75))
    assert len(sent) == 10
    assert sent[-1][:2] == b"\x5e\1"
    assert int.from_bytes(sent[-1][2:5], "little") == 1000
    assert struct.unpack("<Hf", sent[-1][5:]) == (1234, 3.75)
    assert flown.send(5, 1, b"\4\1") == b"\4\1\0"
    assert flown.pass_ms(500) == []
    assert flown.send(5, 1, b"\2\1") == b"\2\1\0"
    assert flown.send(5, 1, b"\2\1") == b"\2\1\2"  # no such block


def test_log_blocks_are_forgotten_a_second_after_the_last_packet() -> None:
    # log.c: a block that is due without a connection deletes all; RADIO_ACTIVITY_TIMEOUT_MS is 1000.
    flown = Flown()
    front = items(flown, 5)["range.front"][0]
    for number in (1, 2):
        assert flown.send(5, 1, struct.pack("<BBBH", 6, number, 0x22, front)) == bytes([6, number, 0])
    flown.send(5, 1, b"\3\1\x0a")  # each 100 ms
    flown.pass_ms(500)
    flown.has_client = False
    assert len(flown.pass_ms(5000)) == 9  # at 600 to 1400 ms
    flown.has_client = True
    assert flown.pass_ms(1000) == []  # the next client gets none
    assert flown.send(5, 1, struct.pack("<BBBH", 6, 2, 0x22, front)) == b"\6\2\0"


def test_parameters_and_trajectories_outlive_their_client() -> None:
    flown = Flown()  # the firmware forgets log blocks only
    flown.send(2, 3, b"\0ring\0solidRed\0\x08\x05")
    upload(flown, straight(1.0))
    define(flown, 1, 0)
    flown.has_client = False
    flown.pass_ms(3000)
    flown.has_client = True
    assert flown.send(2, 1, struct.pack("<H", items(flown, 2)["ring.solidRed"][0]))[3] == 5
    assert start(flown, 1) == 0


def test_a_block_that_does_not_fit_into_a_packet_is_refused() -> None:
    flown = Flown()
    number = items(flown, 5)["pm.vbat"][0]
    eight = struct.pack("<BH", 0x77, number) * 7
    assert flown.send(5, 1, b"\6\1" + eight) == b"\6\1\7"


def test_it_takes_off_to_the_height_and_flies_as_told() -> None:
    flown = Flown()
    flown.send(7, 0, HOVER)
    assert flown.robot.flight.motion == STANDSTILL  # on the floor it cannot move
    flown.hover(3000)
    flight = flown.robot.flight
    assert flight.state is SupervisorState.FLYING
    assert flight.height_m == pytest.approx(0.5, abs=0.01)
    assert (flight.motion.forward_mps, flight.motion.left_mps) == pytest.approx((0.2, 0.1))
    assert flight.motion.turn_radps == pytest.approx(np.pi / 6)


def test_without_setpoints_it_levels_out_after_half_a_second_and_falls_and_locks_after_two() -> None:
    flown = Flown()
    flown.hover(3000)
    flown.pass_ms(400)
    assert flown.robot.flight.motion != STANDSTILL
    flown.pass_ms(150)
    assert (flown.robot.flight.state, flown.robot.flight.motion) == (SupervisorState.LEVEL_OUT, STANDSTILL)
    assert flown.robot.flight.height_m == pytest.approx(0.5, abs=0.01)
    sent = flown.pass_ms(2500)
    assert flown.robot.flight.state is SupervisorState.LOCKED
    assert flown.robot.flight.height_m == 0.0
    assert [datagram[1:] for datagram in sent if datagram[0] == 0x0C] == [b"SUP: Locked, reboot required\n"]
    flown.hover(1000)
    assert flown.robot.flight.height_m == 0.0


def test_a_stop_with_the_notice_that_setpoints_end_does_not_lock() -> None:
    flown = Flown()
    flown.hover(2000)
    flown.send(7, 0, b"\0")
    flown.send(7, 1, b"\0" + bytes(4))
    flown.pass_ms(4000)
    assert flown.robot.flight.state is SupervisorState.READY
    flown.hover(2000)
    assert flown.robot.flight.height_m > 0.4


@pytest.mark.parametrize(("port", "channel", "data"), [(9, 1, b"\3"), (6, 1, b"\3")])
def test_an_emergency_stop_locks_at_once(port: int, channel: int, data: bytes) -> None:
    flown = Flown()
    flown.hover(2000)
    flown.send(port, channel, data)
    flown.send(7, 0, HOVER)
    flown.pass_ms(TICK_MS)
    assert (flown.robot.flight.state, flown.robot.flight.motion) == (SupervisorState.LOCKED, STANDSTILL)
    assert int.from_bytes(supervisor(flown), "little") >> 6 & 1


def supervisor(flown: Flown) -> bytes:
    """The state's bits."""
    answer = flown.robot.receive(b"\x9c\x0c")
    assert answer is not None
    assert answer[:2] == b"\x9c\x8c"
    return answer[2:]


def test_the_planner_takes_off_goes_to_a_place_and_lands_with_the_motors_off() -> None:
    flown = Flown()
    assert flown.send(8, 0, struct.pack("<BBff?f", 7, 0, 0.6, 0.0, True, 2.0))[3] == 0
    flown.pass_ms(2500)
    assert flown.robot.flight.height_m == pytest.approx(0.6, abs=0.02)
    assert flown.send(8, 0, struct.pack("<BBBBfffff", 12, 0, 0, 0, 1.0, 0.5, 0.8, 0.0, 3.0))[3] == 0
    flown.pass_ms(4000)  # without readings it is where it is told to be
    estimate = flown.robot.flight.estimate
    assert (estimate.x_m, estimate.y_m) == pytest.approx((1.0, 0.5), abs=0.02)
    assert flown.robot.flight.height_m == pytest.approx(0.8, abs=0.02)
    assert flown.send(8, 0, struct.pack("<BBff?f", 8, 0, 0.0, 0.0, True, 2.0))[3] == 0
    flown.pass_ms(5000)
    assert flown.robot.flight.height_m == 0.0
    assert not flown.robot.flight.setpoint.flies
    assert flown.robot.flight.state is SupervisorState.READY


def test_a_battery_is_low_after_five_seconds_below_the_parameters_voltage() -> None:
    flown = Flown()
    state = items(flown, 5)["pm.state"][0]
    flown.send(5, 1, struct.pack("<BBBH", 6, 1, 0x44, state))
    flown.send(5, 1, b"\3\1\x0a")
    charged = flown.pass_ms(1000, battery__voltage_v=np.array(3.3))
    low = flown.pass_ms(6000, battery__voltage_v=np.array(3.1))
    assert [datagram[-1] for datagram in (charged[-1], low[30], low[-1])] == [0, 0, 3]


def straight(x_m: float, duration_s: float = 1.0) -> bytes:
    """A piece from (0, 0, 0.5) to (x, 0, 0.5) at constant speed."""
    axes = [0.0, x_m / duration_s, *[0.0] * 6, *[0.0] * 8, 0.5, *[0.0] * 7, *[0.0] * 8]
    return struct.pack("<33f", *axes, duration_s)


def compressed(*pieces: bytes) -> bytes:
    """From (0, 0, 0.5) on, with the piece without a duration at the end."""
    return struct.pack("<4h", 0, 0, 500, 0) + b"".join(pieces) + bytes(3)


def upload(flown: Flown, data: bytes, offset: int = 0) -> None:
    """Write to the memory of trajectories."""
    for at in range(0, len(data), 24):
        assert flown.send(4, 2, struct.pack("<BI", 0, offset + at) + data[at : at + 24])[5] == 0


def define(flown: Flown, number: int, kind: int, offset: int = 0, pieces: int = 1) -> int:
    """The result of a definition."""
    return flown.send(8, 0, struct.pack("<BBBBIB", 6, number, 1, kind, offset, pieces))[3]


def start(flown: Flown, number: int, *, flags: tuple[int, int, int] = (0, 0, 0), stretch: float = 1.0) -> int:
    """The result of a start; `flags`: relative place, relative yaw, reversed."""
    return flown.send(8, 0, struct.pack("<BBBBBBf", 13, 0, *flags, number, stretch))[3]


def test_an_uploaded_trajectory_is_flown() -> None:
    flown = Flown()
    climb = piece_between(
        TrajectoryPoint(np.zeros(4), np.zeros(4)), TrajectoryPoint(np.array([1.0, 0, 0.7, 0]), np.zeros(4)), 4.0
    )
    data = struct.pack("<33f", *climb.coefficients.ravel(), climb.duration_s)
    upload(flown, data)
    assert flown.send(4, 1, struct.pack("<BIB", 0, 0, 8))[5:] == b"\0" + data[:8]
    assert define(flown, 1, 0) == 0
    assert start(flown, 1, flags=(1, 0, 0)) == 0
    flown.pass_ms(5000)
    assert flown.robot.flight.estimate.x_m == pytest.approx(1.0, abs=0.02)
    assert flown.robot.flight.height_m == pytest.approx(0.7, abs=0.02)
    assert start(flown, 9) != 0
    assert flown.counts["plans_refused"] == 1


def test_trajectories_follow_the_newest_definition_and_the_memory_at_the_start() -> None:
    # crtp_commander_high_level.c: `define_trajectory` overwrites always, `start_trajectory2` reads the memory.
    flown, at_m = Flown(), []
    upload(flown, straight(1.0))
    define(flown, 1, 0)
    for data, kind in (
        (straight(1.0), None),
        (straight(-1.0), None),
        (compressed(b"\1" + struct.pack("<Hh", 1000, -700)), 1),
    ):
        upload(flown, data)
        if kind is not None:
            assert define(flown, 1, kind) == 0
        assert start(flown, 1) == 0
        flown.pass_ms(6000)
        at_m.append(flown.robot.flight.estimate.x_m)
    assert at_m == pytest.approx([1.0, -1.0, -0.7], abs=0.02)


def test_trajectories_that_the_memory_does_not_hold_are_refused() -> None:
    flown = Flown()
    assert define(flown, 1, 0, pieces=3) == 0  # the firmware takes every definition
    upload(flown, straight(1.0))
    assert start(flown, 1) == 8  # the second piece has no duration
    define(flown, 1, 1, offset=4090)
    assert start(flown, 1) == 8
    define(flown, 1, 2)  # no type of the firmware
    assert start(flown, 1) == 8
    flown.pass_ms(1000)
    assert flown.robot.flight.state is SupervisorState.READY
    assert flown.counts["plans_refused"] == 3
    assert define(flown, 31, 0) == 8  # NUM_TRAJECTORY_DEFINITIONS


def test_compressed_trajectories_are_bezier_curves_in_mm_and_tenths_of_a_degree() -> None:
    # x: linear to 0.4 m; y: cubic with 0, 0.1, 0.3, 0.2 m; z: constant; yaw: seventh degree, 0 to 90 degrees.
    x_y, z_yaw = struct.pack("<4h", 400, 100, 300, 200), struct.pack("<7h", 0, 0, 0, 900, 900, 900, 900)
    pieces = b"\xc9" + struct.pack("<H", 2000) + x_y + z_yaw, b"\1" + struct.pack("<Hh", 500, 1400)
    first, second = compressed_pieces_of(b"--" + compressed(*pieces), 2) or []
    half = first.at(1.0)  # Bernstein: (p0 + 3 p1 + 3 p2 + p3) / 8, and 35 + 21 + 7 + 1 of 128 of 90 degrees
    assert half.pose == pytest.approx([0.2, (0.3 + 0.9 + 0.2) / 8, 0.5, np.pi / 4])
    assert half.velocity[:3] == pytest.approx([0.2, 3.0 * (0.2 + 0.3 - 0.1) / 4 / 2.0, 0.0])
    assert second.at(0.0).pose == pytest.approx(first.at(2.0).pose)
    assert second.at(0.5).pose == pytest.approx([1.4, 0.2, 0.5, np.pi / 2])
    assert compressed_pieces_of(compressed(*pieces)[:-3], 0) is None  # without an end


@pytest.mark.parametrize(("flags", "stretch"), [((0, 0, 1), 1.0), ((0, 0, 0), 2.0)])
def test_compressed_trajectories_are_refused_reversed_and_stretched(
    flags: tuple[int, int, int], stretch: float
) -> None:
    flown = Flown()  # ENOEXEC, as in the firmware
    upload(flown, compressed(b"\1" + struct.pack("<Hh", 1000, 500)))
    define(flown, 1, 1)
    assert start(flown, 1, flags=flags, stretch=stretch) == 8
    assert start(flown, 1) == 0


def test_a_trajectory_relative_to_the_yaw_is_turned_to_it() -> None:
    flown = Flown()
    flown.send(6, 1, struct.pack("<B7f", 8, 1.0, 2.0, 0.0, 0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)))  # yaw 90 degrees
    flown.send(8, 0, struct.pack("<BBff?f", 7, 0, 0.6, 0.0, True, 2.0))
    flown.pass_ms(2500)
    upload(flown, straight(1.0))
    define(flown, 1, 0)
    assert start(flown, 1, flags=(1, 1, 0)) == 0
    flown.pass_ms(5000)
    estimate = flown.robot.flight.estimate
    assert (estimate.x_m, estimate.y_m, estimate.yaw_rad) == pytest.approx((1.0, 3.0, np.pi / 2), abs=0.02)


def test_a_pose_from_outside_is_the_estimate_of_a_body_without_positioning() -> None:
    flown = Flown()
    flown.send(6, 1, struct.pack("<B7f", 8, 1.0, 2.0, 0.0, 0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)))
    estimate = flown.robot.flight.estimate
    assert (estimate.x_m, estimate.y_m, estimate.yaw_rad) == pytest.approx((1.0, 2.0, np.pi / 2))


def test_a_packed_attitude_comes_back() -> None:
    half = round(0x1FF * np.sin(0.3) * np.sqrt(2.0))  # a turn by 0.6 rad about z: w is the largest
    assert unpacked_attitude(3 << 30 | half) == pytest.approx((0.0, 0.0, np.sin(0.3), np.cos(0.3)), abs=2e-3)


@given(datagram=st.binary(max_size=40))
def test_no_datagram_breaks_it(datagram: bytes) -> None:
    flown = Flown()
    flown.robot.receive(datagram)
    flown.pass_ms(100)
    assert np.isfinite(flown.robot.flight.height_m)


def test_a_body_that_is_no_crazyflie_is_refused() -> None:
    with pytest.raises(BadInput, match="epuck2: drive.kind"):
        check_fits(load_body("epuck2"))
    rays = {"rays": 5, "range_m": 4.0}
    with pytest.raises(BadInput, match=r"sensors\.scan"):
        check_fits(body_from({"like": "crazyflie", "sensors": {"scan": rays}}, "many.toml"))


@pytest.mark.parametrize("address", ["127.0.0.1", "127.0.0.1:x", ":1", "127.0.0.1:65535"])
def test_an_address_without_enough_ports_is_refused(address: str) -> None:
    with pytest.raises(BadInput, match="gateway crazyflie: address"):
        addresses_of(address, 2)

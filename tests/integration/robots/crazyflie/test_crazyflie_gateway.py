"""Unmodified cflib against emulated Crazyflies that follow commands."""

from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread

import cflib.crtp
import numpy as np
import pytest
from cflib.crazyflie import Crazyflie
from cflib.crazyflie.log import LogConfig
from cflib.crazyflie.mem import CompressedSegment, CompressedStart, MemoryElement
from cflib.crazyflie.syncCrazyflie import SyncCrazyflie
from cflib.crazyflie.syncLogger import SyncLogger
from cflib.positioning.motion_commander import MotionCommander
from cflib.utils.multiranger import Multiranger

from swarmwire.comms.base.clock import NS_PER_S, WallClock
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.world.gateways.crazyflie import CrazyflieGateway

TICK_S = 0.02


class Room:
    """A gateway of one Crazyflie, and a thread that moves it as commanded: flow and IMU are exact."""

    def __init__(self) -> None:
        self.clock = WallClock()
        self.gateway = CrazyflieGateway(["a-0"], load_body("crazyflie"), "", None, self.clock)
        (self.uri,) = self.gateway.open()
        self.travelled_m = np.zeros(2)  # ahead and to the left
        self.turned_rad = 0.0
        self.voltage_v = 3.9
        self.motors: list[float] = []  # as they were switched
        self._ended = Event()
        self._thread = Thread(target=self._pass, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End both."""
        self._ended.set()
        self._thread.join()
        self.gateway.close()

    def _pass(self) -> None:
        tick, speeds = 0, np.zeros(3)
        began_ns = self.clock.now_ns()
        while not self._ended.is_set():
            fields = {"flow.forward_mps": speeds[:1], "flow.left_mps": speeds[1:2], "imu.turn_radps": speeds[2:]}
            fields["scan.range_m"] = np.array([[1.5, 0.4, np.inf, 2.0]])
            fields["battery.voltage_v"] = np.array([self.voltage_v])
            time_ns = round(tick * TICK_S * NS_PER_S)
            self.gateway.publish(time_ns, fields, np.array([True]))
            self.clock.sleep_until(began_ns + time_ns)
            commands = self.gateway.pop_commands()
            self.motors += commands.motors.value.tolist()
            if commands.drive[0]:
                speeds = np.array([commands.linear_mps[0], commands.lateral_mps[0], commands.angular_radps[0]])
            self.travelled_m += speeds[:2] * TICK_S
            self.turned_rad += float(speeds[2]) * TICK_S
            tick += 1


@pytest.fixture
def room() -> Iterator[Room]:
    cflib.crtp.CLASSES.clear()
    cflib.crtp.CLASSES.append(cflib.crtp.UdpDriver)  # the others look for USB devices
    room = Room()
    yield room
    room.close()


@contextmanager
def connected_client(uri: str, cache: Path | None = None) -> Generator[SyncCrazyflie]:
    """Connect cflib's Crazyflie; at the end its pings stop before the link closes, since one that meets that fails."""
    with SyncCrazyflie(uri, cf=Crazyflie(rw_cache=str(cache) if cache else None)) as scf:
        yield scf
        scf.cf.link_statistics.stop()


def test_motion_commander_and_multiranger_fly_an_emulated_crazyflie(room: Room, tmp_path: Path) -> None:
    with connected_client(room.uri, tmp_path) as scf:
        scf.wait_for_params()
        assert scf.cf.param.get_value("deck.bcMultiranger") == "1"
        assert scf.cf.supervisor.can_fly
        with MotionCommander(scf, default_height=0.3) as commander, Multiranger(scf) as ranger:
            commander.forward(0.3, velocity=0.5)
            assert (ranger.front, ranger.left, ranger.back, ranger.right) == (1.5, 0.4, None, 2.0)
            assert ranger.down == pytest.approx(0.3, abs=0.05)
            commander.turn_left(45)
            assert scf.cf.supervisor.is_flying
    assert room.travelled_m == pytest.approx([0.3, 0.0], abs=0.15)  # set-points and ticks are not in step
    assert room.turned_rad == pytest.approx(np.pi / 4, abs=0.4)
    assert room.gateway.counts() == {}


def test_high_level_commander_flies_to_a_position_that_logs_show(room: Room) -> None:
    with connected_client(room.uri) as scf:
        scf.wait_for_params()
        commander = scf.cf.high_level_commander
        commander.takeoff(0.5, 0.5, yaw=None)
        position = LogConfig(name="place", period_in_ms=50)
        for axis in "xyz":
            position.add_variable(f"stateEstimate.{axis}", "float")
        with SyncLogger(scf, position) as logger:
            until(logger, lambda log: log["stateEstimate.z"] > 0.4)
            commander.go_to(0.4, -0.2, 0.6, 0.0, 1.0)
            until(
                logger,
                lambda log: abs(log["stateEstimate.x"] - 0.4) < 0.05 and abs(log["stateEstimate.y"] + 0.2) < 0.05,
            )
            commander.land(0.0, 0.5, yaw=None)
            until(logger, lambda log: log["stateEstimate.z"] == 0.0)
    assert room.travelled_m == pytest.approx([0.4, -0.2], abs=0.1)
    assert room.motors == [0.0, 1.0, 0.0]  # on the floor, in the air, on the floor


def test_compressed_trajectories_end_at_their_last_control_points(room: Room) -> None:
    with connected_client(room.uri) as scf:
        memory = next(mem for mem in scf.cf.mem.mems if mem.type == MemoryElement.TYPE_TRAJ)
        curve = [0.0, 0.0, 0.2, 0.3, 0.4, 0.4, 0.4]
        memory.trajectory = [
            CompressedStart(0.0, 0.0, 0.3, 0.0),
            CompressedSegment(0.6, curve, [0.1, -0.1, -0.2], [0.5], []),
            CompressedSegment(0.2, [], [], [], []),
            CompressedSegment(0.0, [], [], [], []),
        ]
        assert memory.write_data_sync()
        scf.cf.high_level_commander.define_trajectory(3, 0, 4, type=1)
        scf.cf.high_level_commander.takeoff(0.3, 0.3, yaw=None)
        position = LogConfig(name="place", period_in_ms=50)
        for axis in "xyz":
            position.add_variable(f"stateEstimate.{axis}", "float")
        with SyncLogger(scf, position) as logger:
            until(logger, lambda log: log["stateEstimate.z"] > 0.25)
            scf.cf.high_level_commander.start_trajectory(3)
            until(logger, lambda log: log["stateEstimate.z"] > 0.48 and log["stateEstimate.x"] > 0.38)
            scf.cf.high_level_commander.stop()
    assert room.travelled_m == pytest.approx([0.4, -0.2], abs=0.1)
    assert room.gateway.counts() == {}


def until(logger: SyncLogger, holds) -> None:
    """Read on until it holds; the test's time-out ends what never does."""
    for _, values, _ in logger:
        if holds(values):
            return


def test_address_in_use_is_refused(room: Room) -> None:
    second = CrazyflieGateway(["a-0"], load_body("crazyflie"), room.uri.removeprefix("udp://"), None, room.clock)
    with pytest.raises(BadInput, match="gateway crazyflie: address"):
        second.open()

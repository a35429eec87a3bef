"""Robots that others move: the shipped trace, and poses by UDP and of a tracker in real time."""

import json
import shutil
import socket
import subprocess
import sys
from collections.abc import Callable, Generator
from contextlib import closing, contextmanager
from pathlib import Path
from threading import Event, Thread
from typing import Any

import numpy as np
import pytest
from pymavlink import mavutil

from swarmwire.agent import pose_feed
from swarmwire.comms.protocols.ros2.links import close, open_router
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.robot_network import open_swarm
from swarmwire.deploy import repeat, run
from swarmwire.metrics.records.run_folder.reader import RunFolder
from tests.support.comms.protocols.ros2 import independent
from tests.support.comms.protocols.ros2.type_hashes import rihs01
from tests.support.deploy.runs import ROOT, At
from tests.support.refusals import refused_input
from tests.support.world.gateways import PROPER

TRACED = ROOT / "scenarios" / "traced.toml"
UDP = ROOT / "examples" / "motion" / "udp.toml"
ROWS = """
format = 1
name = "poses from outside"
duration_s = 2.0
time = {{ rate_hz = 40 }}
arena = {{ size_m = [40.0, 10.0] }}
[robots.row]
body = "epuck2"
count = 2
act_every_ticks = 2  # in every other tick only poses are recorded
agent = "swarmwire.agent.behaviours:Consensus"
motion = {{ source = "{source}", {settings} }}
[radio]
range_m = 5.0
"""


def free_port(kind: socket.SocketKind) -> int:
    """A port that the system chose; a moment later it is still free, or the test fails aloud."""
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def sending(send: Callable[[int], None], rate_hz: int = 50) -> Generator[None]:
    """Call `send` with 0, 1, … at a rate within the context."""
    over = Event()

    def go() -> None:
        k = 0
        while not over.wait(1.0 / rate_hz):
            send(k)
            k += 1

    thread = Thread(target=go)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def scenario(folder: Path, source: str, settings: str) -> Path:
    """A scenario of two robots with this source."""
    path = folder / "rows.toml"
    path.write_text(ROWS.format(source=source, settings=settings))
    return path


def test_traced_run_is_the_same_with_agents_in_this_process_and_in_two_others():
    alone, apart = (run(TRACED, overrides=["duration_s=5"], runners=runners) for runners in (None, 2))
    assert alone.trajectory_sha256 == apart.trajectory_sha256
    assert alone.radio == apart.radio
    assert alone.radio.fates["received"] > 0


def test_traced_run_repeats_from_its_folder_alone(tmp_path):
    first = run(TRACED, overrides=["duration_s=2"], out=tmp_path / "run")
    assert (tmp_path / "run" / "files" / "walk.movements").is_file()
    again = repeat(tmp_path / "run")
    assert again.same
    assert again.result.radio == first.radio


def test_recorded_run_is_followed_bit_for_bit_and_the_second_run_needs_neither(tmp_path):
    overrides = ["duration_s=2", "time.rate_hz=30", "robots.walkers.motion.start_s=40"]  # 1/30 s is no whole ns
    run(TRACED, overrides=overrides, out=tmp_path / "first")
    names = ["walkers-7", "walkers-2"]
    motion = ["robots.walkers.count=2", f"robots.walkers.motion={{source='trace', file='first', robots={names}}}"]
    (tmp_path / "again.toml").write_text(TRACED.read_text())
    run(tmp_path / "again.toml", overrides=[*overrides[:2], *motion], out=tmp_path / "again")
    before, after = (RunFolder(tmp_path / name).ticks() for name in ("first", "again"))
    for column in ("x_m", "y_m", "z_m", "heading_rad"):
        np.testing.assert_array_equal(after[column].to_numpy(), before[column].to_numpy()[:, [7, 2]])
    shutil.rmtree(tmp_path / "first")
    assert repeat(tmp_path / "again").same


@pytest.mark.parametrize("subtick", [None, 0.001])
def test_udp_poses_decide_who_is_in_range_and_the_run_repeats_without_them(tmp_path, subtick):
    port = free_port(socket.SOCK_DGRAM)
    path = scenario(tmp_path, "udp", f'listen = "127.0.0.1:{port}"')
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    away = Event()  # set from the middle of the run on

    def send(_: int) -> None:
        x_m = 8.0 if away.is_set() else 3.0  # the range is 5 m
        for name, x in (("row-0", 0.0), ("row-1", x_m), ("ghost", 0.0)):
            message: dict[str, Any] = {"robot": name, "x_m": x, "y_m": 0.0, "heading_rad": 0.5}
            sender.sendto(json.dumps(message).encode(), ("127.0.0.1", port))
        sender.sendto(b"{", ("127.0.0.1", port))

    with sender, sending(send):
        result = run(path, realtime=1.0, subtick=subtick, out=tmp_path / "run", observers=[At(40, away.set)])
    assert result.radio.fates["received"] > 20
    assert result.radio.fates["out_of_range"] > 10
    assert result.counts["poses_of_unknown"] > 0
    assert result.counts["poses_malformed"] > 0
    assert result.poses[0].received > 20
    assert result.poses[0].use
    assert set(result.poses[0].longest_gap_s) == {"row-0", "row-1"}
    assert RunFolder(tmp_path / "run").ticks()["x_m"].to_numpy()[0].tolist() == [0.0, 3.0]
    again = repeat(tmp_path / "run")
    assert again.same
    assert again.result.radio == result.radio


def test_mavlink_poses_of_two_vehicles_decide_who_is_in_range_and_are_recorded(tmp_path):
    port = free_port(socket.SOCK_DGRAM)
    path = scenario(tmp_path, "mavlink", f'listen = "udpin:127.0.0.1:{port}", origin = [0.0, 0.0, 100.0]')
    vehicles = [
        mavutil.mavlink_connection(f"udpout:127.0.0.1:{port}", source_system=k, source_component=1) for k in (1, 2)
    ]

    def send(_: int) -> None:
        for vehicle, longitude in zip(vehicles, (0, 300), strict=True):
            vehicle.mav.heartbeat_send(2, 3, 0, 0, 4)  # of an ArduPilot quadrotor, which is active
            vehicle.mav.global_position_int_send(0, 100, longitude, 102_500, 0, 0, 0, 0, 9_000)

    try:
        with sending(send):
            result = run(path, realtime=1.0, out=tmp_path / "run")
    finally:
        for vehicle in vehicles:
            vehicle.close()
    assert (result.counts.get("poses_malformed", 0), result.counts.get("poses_of_unknown", 0)) == (0, 0)
    assert result.radio.fates["received"] > 20
    ticks = RunFolder(tmp_path / "run").ticks()
    # At the equator the radius of curvature is a = 6378137 m to the east, a (1 - e2) = 6335439.327 m to the north.
    assert ticks["x_m"].to_numpy()[-1] == pytest.approx([0.0, (6378137.0 + 102.5) * np.deg2rad(3e-5)], rel=1e-6)
    assert ticks["y_m"].to_numpy()[-1] == pytest.approx([(6335439.327 + 102.5) * np.deg2rad(1e-5)] * 2, rel=1e-6)
    assert ticks["z_m"].to_numpy()[-1] == pytest.approx([2.5, 2.5])
    assert ticks["heading_rad"].to_numpy()[-1] == pytest.approx([0.0, 0.0])


def test_tracker_poses_move_robots(tmp_path):
    port = free_port(socket.SOCK_STREAM)
    path = scenario(tmp_path, "zenoh", f'swarm = "arena", listen = ["tcp/127.0.0.1:{port}"]')
    feed = Feed()
    thread = Thread(target=feed.run, args=(f"tcp/127.0.0.1:{port}",))
    thread.start()
    try:
        result = run(path, realtime=1.0)
    finally:
        feed.over.set()
        thread.join()
    assert result.poses[0].received > 0
    assert result.radio.fates["received"] > 0


def test_ros2_poses_decide_who_is_in_range_and_the_run_repeats_without_them(tmp_path):
    endpoint = f"tcp/127.0.0.1:{free_port(socket.SOCK_STREAM)}"
    path = scenario(tmp_path, "ros2", f'connect = ["{endpoint}"]')
    router, _ = open_router(endpoint)
    still = independent.TwistWithCovariance(independent.Twist(), [0.0] * 36)

    def send(k: int) -> None:
        x_m = 8.0 if k % 50 >= 25 else 3.0  # the range is 5 m
        for name, x in (("row_0", 0.0), ("row_1", x_m)):
            pose = independent.Pose(independent.Point(x, 1.0, 0.5), independent.Quaternion(0.0, 0.0, 1.0, 1.0))
            posed = independent.PoseWithCovariance(pose, [0.0] * 36)
            message = independent.Odometry(independent.header(0, "odom"), "base_link", posed, still)
            key = f"0/{name}/odom/nav_msgs::msg::dds_::Odometry_/{rihs01(independent.Odometry)}"
            router.put(key, message.serialize(), attachment=PROPER)

    try:
        with sending(send):
            overrides = ["robots.row.motion.max_speed_mps=10000"]
            result = run(path, overrides=overrides, realtime=1.0, out=tmp_path / "run")
    finally:
        close(router)
    assert result.radio.fates["received"] > 5
    assert result.radio.fates["out_of_range"] > 5
    assert result.poses[0].received > 50
    ticks = RunFolder(tmp_path / "run").ticks()
    assert set(ticks["x_m"].to_numpy()[-1].tolist()) <= {0.0, 3.0, 8.0}
    assert ticks["z_m"].to_numpy()[-1] == pytest.approx(0.5)
    assert ticks["heading_rad"].to_numpy()[-1] == pytest.approx(np.pi / 2)
    assert repeat(tmp_path / "run").same


class Feed:
    """The standing robots that `pose_feed` publishes."""

    def __init__(self) -> None:
        self.over = Event()

    def lines(self) -> Generator[str]:
        while not self.over.wait(0.02):
            yield "row-0 0 0 0\n"
            yield "row-1 1 0 0\n"

    def run(self, endpoint: str) -> None:
        with closing(open_swarm(Network(connect=(endpoint,)))) as session:
            while not self.over.is_set() and pose_feed._feed(session, "arena", 1, self.lines()):
                pass


@pytest.mark.parametrize(("options", "key"), [({}, "source"), ({"realtime": 1.0, "seeds": 2}, "source")])
def test_live_poses_need_real_time_and_one_seed(tmp_path, options, key):
    with refused_input(key=f"robots.row.motion.{key}"):
        run(scenario(tmp_path, "udp", 'listen = "127.0.0.1:0"'), **options)


def test_live_run_whose_poses_do_not_come_is_refused_before_its_first_tick(tmp_path):
    path = scenario(tmp_path, "udp", 'listen = "127.0.0.1:0", wait_s = 0.2')
    with refused_input(match="none yet of row-0, row-1"):
        run(path, realtime=1.0)


@pytest.mark.parametrize("listen", ["nowhere", "127.0.0.1:99999", "192.0.2.1:9870"])
def test_udp_address_that_cannot_be_used_is_refused(tmp_path, listen):
    with refused_input(key="robots.row.motion.listen"):
        run(scenario(tmp_path, "udp", f'listen = "{listen}"'), realtime=1.0)


def test_simulator_example_moves_ten_robots_apart(tmp_path):
    port = free_port(socket.SOCK_DGRAM)
    program = ROOT / "examples" / "motion" / "simulator.py"
    simulator = subprocess.Popen([sys.executable, program, f"127.0.0.1:{port}", "100"])
    try:
        overrides = ["duration_s=6", f'robots.row.motion.listen="127.0.0.1:{port}"']
        result = run(UDP, realtime=1.0, overrides=overrides, out=tmp_path / "run")
    finally:
        simulator.kill()
        simulator.wait()
    assert result.counts.get("poses_malformed", 0) == 0
    assert result.poses[0].received > 6 * 20 * 10 * 0.8
    ticks = RunFolder(tmp_path / "run").ticks()
    gap_m = np.diff(ticks["x_m"].to_numpy(), axis=1)
    assert gap_m[-1] == pytest.approx(gap_m[-1, 0], rel=1e-3)
    # 60 m x (1 - cos(2 pi 6 / 40)) / 2 after 6 s: 12 m, less what the start took
    assert gap_m[-1, 0] > gap_m[5, 0] + 3.0
    assert not ticks["z_m"].to_numpy().any()

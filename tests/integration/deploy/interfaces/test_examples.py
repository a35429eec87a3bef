"""Unmodified programs on robots: what they measure of the radio, discovery by multicast, and routing."""

import json
import re
import socket
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import polars as pl
import pytest
from scipy import stats
from scipy.sparse.csgraph import connected_components

from swarmwire.comms.protocols.ros2.keys import POSE_STAMPED
from swarmwire.metrics.records.run_folder.reader import RunFolder
from tests.support.clocks import until
from tests.support.comms.protocols.ros2.definitions import write_definitions
from tests.support.deploy.interfaces import (
    DISK,
    InterfacesRun,
    line,
    needs_interfaces,
    needs_program,
    running,
    with_program,
)
from tests.support.deploy.runs import ROOT, swarmwire

pytestmark = needs_interfaces
LOSS = 0.2
DATAGRAMS = 1000
FALSE_ALARM = 1e-4  # of each binomial interval
BABELD = "exec babeld -I '' -S '' -h 1 -H 1 -L $ROBOT_SCRATCH/babeld.log -C 'default type wireless' radio0"

RECEIVER = """
import socket, sys

inbox = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
inbox.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
inbox.bind(("0.0.0.0", 9000))
inbox.settimeout(2.0)
open("ready-" + sys.argv[1], "w").close()
received = 0
try:
    while True:
        inbox.settimeout(60.0 if not received else 2.0)
        inbox.recv(2048)
        received += 1
except TimeoutError:
    print(received)
"""
SENDER = """
import socket, sys, time

out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
out.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
for number in range(int(sys.argv[2])):
    out.sendto(bytes(100), (sys.argv[1], 9000))
    time.sleep(0.002)
"""
ZENOH = """
import sys, time
import zenoh

config = zenoh.Config()
config.insert_json5("scouting/multicast/interface", '"radio0"')
config.insert_json5("listen/endpoints", '["tcp/0.0.0.0:0"]')
with zenoh.open(config) as session:
    inbox = session.declare_subscriber("swarm/*")
    while True:
        session.put("swarm/" + sys.argv[1], "here")
        sample = inbox.try_recv()
        while sample is not None:
            print(sample.key_expr, flush=True)
            sample = inbox.try_recv()
        time.sleep(0.1)
"""
DDS = """
import sys, time
from dataclasses import dataclass
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

@dataclass
class Here(IdlStruct, typename="Here"):
    robot: str

participant = DomainParticipant(0)
topic = Topic(participant, "here", Here)
writer, reader = DataWriter(participant, topic), DataReader(participant, topic, qos=Qos(Policy.History.KeepAll))
while True:
    writer.write(Here(sys.argv[1]))
    for sample in reader.take(10):
        if sample is not None:
            print(sample.robot, flush=True)
    time.sleep(0.1)
"""
NETWORK = "<General><Interfaces><NetworkInterface name='radio0'/></Interfaces></General>"
CYCLONE = f"<CycloneDDS><Domain>{NETWORK}</Domain></CycloneDDS>"


@pytest.mark.parametrize("to", ["10.77.0.2", "10.77.255.255"])
def test_udp_loses_what_the_radio_loses(tmp_path, to):
    programs = {"receiver.py": RECEIVER, "sender.py": SENDER}
    scenario = with_program(line(3, spacing_m=0.5), sys.executable, "receiver.py", "x") + DISK
    with running(tmp_path, scenario + f"loss = {LOSS}\n", files=programs) as world:
        until((tmp_path / "ready-x").exists)
        sender = (sys.executable, str(tmp_path / "sender.py"))
        assert world.on("line-0", *sender, to, str(DATAGRAMS)).returncode == 0
        until(lambda: world.output("line-1"))
        received = int(world.output("line-1"))
        world.end()
    low, high = stats.binom.interval(1 - FALSE_ALARM, DATAGRAMS, 1 - LOSS)
    # A unicast datagram waits for ARP, whose losses may cost the first few.
    assert low - (3 if to.endswith(".2") else 0) <= received <= high


@needs_program("iperf3")
def test_tcp_is_slower_where_the_radio_loses(tmp_path):
    """6 Mbit/s and a round trip of 40 ms: at a loss of a tenth, 1.1 Mbit/s (Mathis et al., ACM CCR 27, 1997)."""
    rates_bps: list[float] = []
    for loss in (0.0, 0.1):
        folder = tmp_path / str(loss)
        folder.mkdir()
        server = with_program(line(2), "iperf3", "-s", "--forceflush") + DISK + f"latency_s = 0.02\nloss = {loss}\n"
        with running(folder, server) as world:
            until(lambda world=world: "listening" in world.output("line-1"))
            done = world.on("line-0", "iperf3", "-c", world.address("line-1"), "-C", "reno", "-t", "4", "-J")
            rates_bps.append(json.loads(done.stdout)["end"]["sum_received"]["bits_per_second"])
            world.end()
    clean_bps, lossy_bps = rates_bps
    assert 1e6 < clean_bps < 6e6
    assert 1e4 < lossy_bps < 0.5 * clean_bps


@needs_program("iperf3")
def test_tcp_over_80211n_takes_slower_bit_rates_as_robots_drive_apart(tmp_path, monkeypatch):
    """65 Mbit/s side by side, at most 39 beyond 48 m: bits of a PPDU over its time on air, headers not counted."""
    monkeypatch.setenv("IPERF3_S", "7")
    examples = ROOT / "examples" / "interfaces"
    files = {name: (examples / name).read_text() for name in ("standing.py", "adaptive.movements")}
    files["adaptive.movements"] = "0 5 0 3 5 0 6 54 0 9 54 0"  # iperf3 begins a second after the run or later
    scenario = (examples / "adaptive.toml").read_text()
    with running(tmp_path, scenario, "--set", "duration_s=9", "--packets", "all", files=files) as world:
        world.process.wait(60.0)
    packets = RunFolder(world.folder).packets()
    packets = packets.filter((packets["sender"] == 1) & (packets["fate"] == "received"))
    sums = pl.col("size_bytes").sum(), pl.col("final_at_ns").max(), pl.col("distance_m").mean()
    ppdus = packets.group_by("on_air_at_ns").agg(*sums)
    rates_mbps = 8e3 * ppdus["size_bytes"] / (ppdus["final_at_ns"] - ppdus["on_air_at_ns"])
    near_mbps = rates_mbps.filter(ppdus["distance_m"] < 10).to_numpy().max()
    far_mbps = rates_mbps.filter(ppdus["distance_m"] > 48).to_numpy().max()
    assert 55 < near_mbps < 65
    assert 10 < far_mbps < 39


ROS2_SIMULATOR = """
import runpy, sys
from zenoh_ros2_sdk.message_registry import get_registry

get_registry(sys.argv.pop(1))  # definitions of messages, which it would clone from the network
runpy.run_path(sys.argv.pop(1), run_name="__main__")
"""


@needs_program("iperf3")
@pytest.mark.parametrize("source", ["udp", "ros2"])
def test_iperf3_throughput_follows_the_distance_of_robots_that_another_simulator_moves(tmp_path, monkeypatch, source):
    """Rayleigh fading above a threshold that path loss reaches at R: exp(-(d / R)^n) (Rappaport 1996, section 5.6)."""
    monkeypatch.setenv("IPERF3_S", "8")
    for example in ("iperf3.sh", "throughput.py", "throughput.toml"):
        (tmp_path / example).write_bytes((ROOT / "examples" / "motion" / example).read_bytes())
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM if source == "udp" else socket.SOCK_STREAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = str(probe.getsockname()[1])
    scenario = (tmp_path / "throughput.toml").read_text()
    scenario = scenario.replace("../interfaces/standing.py:Standing", "still.py:Still")
    motion, examples = f"source='udp', listen='127.0.0.1:{port}'", ROOT / "examples" / "motion"
    command = [sys.executable, str(examples / "simulator.py"), f"127.0.0.1:{port}", "60", "9"]
    if source == "ros2":
        pytest.importorskip("zenoh_ros2_sdk", reason="needs the development group")
        motion = f"source='ros2', type='{POSE_STAMPED}', listen=['tcp/127.0.0.1:{port}']"
        definitions = write_definitions(tmp_path / "messages", [POSE_STAMPED])
        command = [sys.executable, "-c", ROS2_SIMULATOR, str(definitions), str(examples / "ros2_simulator.py")]
        command += [port, "60", "9"]
        monkeypatch.setenv("PYTHONPATH", str(examples))
    options = ("--set", f"robots.row.motion={{{motion}}}", "--set", "duration_s=13", "--packets", "all")
    log = tmp_path / "out" / "log.txt"

    def simulator() -> subprocess.Popen[bytes]:
        until(lambda: log.exists() and f"127.0.0.1:{port}" in log.read_text())  # the run is open for poses
        return subprocess.Popen(command)

    with ThreadPoolExecutor(1) as pool:
        started = pool.submit(simulator)
        with running(tmp_path, scenario, *options) as world:
            world.process.wait(60.0)
        started.result().kill()
        started.result().wait()
    program = [sys.executable, str(tmp_path / "throughput.py"), str(world.folder)]
    done = subprocess.run(program, capture_output=True, text=True, check=False)
    rows = [[float(number) for number in re.findall(r"[\d.]+", row)] for row in done.stdout.splitlines()[1:]]
    assert len(rows) >= 4, done.stderr
    reach_m = 10 ** ((16.0 + 82.0 - 20 * np.log10(4 * np.pi * 5.18e9 / 299_792_458)) / 30)
    for distance_m, measured_mbps, _ in rows:  # within a second the distance changes by up to 20 m
        nearest, farthest = np.exp(-(((distance_m + np.array([-10, 10])).clip(10, 70) / reach_m) ** 3))
        assert farthest - 0.2 < measured_mbps < nearest + 0.2
    assert np.mean([measured - expected for _, measured, expected in rows]) == pytest.approx(0.0, abs=0.1)
    fates = json.loads((world.folder / "summary.json").read_text())["radio"]["fates"]
    assert fates["out_of_range"] > 0


def test_zenoh_peers_find_one_another_by_multicast(tmp_path):
    scenario = with_program(line(2), "sh", "-c", f"exec {sys.executable} zenoh_peer.py $ROBOT") + DISK
    with running(tmp_path, scenario, files={"zenoh_peer.py": ZENOH}) as world:
        until(lambda: "swarm/line-1" in world.output("line-0") and "swarm/line-0" in world.output("line-1"))
        world.end()


def test_dds_participants_discover_one_another_and_exchange(tmp_path):
    pytest.importorskip("cyclonedds")
    command = f'CYCLONEDDS_URI="{CYCLONE}" exec {sys.executable} dds.py $ROBOT'
    scenario = with_program(line(2), "sh", "-c", command) + DISK
    with running(tmp_path, scenario, files={"dds.py": DDS}) as world:
        until(lambda: "line-1" in world.output("line-0") and "line-0" in world.output("line-1"))
        world.end()


def hops(world: InterfacesRun, to: str) -> list[str]:
    """Addresses of the robots over which line-0 reaches another, in order; none if it does not."""
    route: list[str] = []
    robot = "line-0"
    names = {world.address(name): name for name in world.robots}
    while robot != to:
        route_text = world.on(robot, "ip", "route", "get", world.address(to)).stdout
        via = re.search(r"via ([\d.]+)", route_text)
        robot = names[via[1]] if via else to
        if robot in route:
            return []  # a loop while routes change
        route.append(robot)
    return route


@needs_program("babeld", "ping", "ip")
def test_babeld_routes_over_many_hops_and_around_a_dead_robot(tmp_path):
    """Ten robots in a line that is doubled in its middle: the death of a robot moves the route to the one beside it."""
    poses = [[1.5 * i, 0.0, 0.0] for i in range(9)] + [[1.5 * 4, 0.8, 0.0]]
    scenario = re.sub(r"poses = \[\[.*\]\]", f"poses = {poses}", with_program(line(10), "sh", "-c", BABELD))
    with running(tmp_path, scenario + DISK) as world:
        far = world.address("line-8")
        until(lambda: world.on("line-0", "ping", "-c", "1", "-W", "1", far).returncode == 0)
        route = until(lambda: hops(world, "line-8"), lambda addresses: len(addresses) == 8)
        on_way = next(name for name in route if name in ("line-4", "line-9"))
        other = "line-9" if on_way == "line-4" else "line-4"
        assert swarmwire("ctl", "--run", world.folder, "kill", on_way).returncode == 0
        until(lambda: other in hops(world, "line-8"))
        until(lambda: world.on("line-0", "ping", "-c", "1", "-W", "1", far).returncode == 0)
        world.end()


@needs_program("babeld", "ping", "ip")
def test_babeld_routes_between_walkers_of_a_trace_over_several_hops(tmp_path):
    """The trace gives the distances at the start; the two farthest walkers that are connected need others between."""
    scenario = (ROOT / "examples" / "motion" / "mesh.toml").read_text()
    for beside, folder in (("../../scenarios", "scenarios"), ("../interfaces", "examples/interfaces")):
        scenario = scenario.replace(beside, f"{ROOT}/{folder}")
    with running(tmp_path, scenario) as world:
        lines = (ROOT / "scenarios" / "walk.movements").read_text().splitlines()
        start_m = np.array([line.split()[1:3] for line in lines], float)
        away_m = np.hypot(*(start_m[:, None] - start_m).transpose(2, 0, 1))
        _, member = connected_components(away_m < 140.0)
        one = int(np.argmax(np.bincount(member)[member]))
        same = np.flatnonzero(member == member[one])
        other = int(same[np.argmax(away_m[one, same])])
        assert away_m[one, other] > 150.0
        address = world.address(f"walkers-{other}")
        until(lambda: world.on(f"walkers-{one}", "ping", "-c", "1", "-W", "1", address).returncode == 0)
        route = world.on(f"walkers-{one}", "ip", "route", "get", address).stdout
        assert "via" in route
        world.end()

"""Programs that change, break or overuse the network of their robot: the world and the other robots go on."""

import json
import sys

from swarmwire.metrics.records.run_folder.reader import RunFolder
from tests.support.clocks import until
from tests.support.deploy.interfaces import (
    DISK,
    InterfacesRun,
    line,
    needs_interfaces,
    needs_program,
    running,
    with_program,
)
from tests.support.deploy.runs import swarmwire

pytestmark = [needs_interfaces, needs_program("ip", "ping", "unshare")]
CLOSE = 0.25  # m between robots: all are in range of one another
GROUPS = "239.255.7.7", "255.255.255.255"
SENDER = "10.77.0.1"
DELETED = "ip link del radio0"
MOVED = "unshare --net sleep 0.5 & sleep 0.2; ip link set radio0 netns $!; wait"

# A beacon as it is often written: the address of no interface is said.
BEACON = """
import socket, sys, time

group, program = sys.argv[1:]
beacon = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
beacon.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
if program == "send":
    beacon.sendto(b"here", (group, 9000))
else:
    beacon.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    beacon.bind((group, 9000))
    if group != "255.255.255.255":
        any_interface = socket.inet_aton("0.0.0.0")
        beacon.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, socket.inet_aton(group) + any_interface)
    print("ready", flush=True)
    for _ in range(int(program)):
        print(group, beacon.recvfrom(100)[1][0], flush=True)
"""
# Sends frames with this station's address until the time is over; `sys.argv`: to, bytes of data, seconds.
RAW = """
import socket, sys, time

to, size, seconds = bytes.fromhex(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])
device = socket.socket(socket.AF_PACKET, socket.SOCK_RAW)
device.bind(("radio0", 0))
station = open("/sys/class/net/radio0/address").read().replace(":", "")
frame = to + bytes.fromhex(station) + bytes.fromhex("88b5") + bytes(size)
end = time.monotonic() + seconds
device.send(frame)
while time.monotonic() < end:
    try:
        device.send(frame)
    except OSError:
        pass
"""


def reaches(world: InterfacesRun, robot: str, to: str) -> bool:
    return world.on(robot, "ping", "-c", "3", "-i", "0.1", "-W", "2", to).returncode == 0


def shell(world: InterfacesRun, robot: str, script: str) -> str:
    done = world.on(robot, "sh", "-ec", script)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_interface_lost_takes_its_robot_off_the_air_and_no_other(tmp_path):
    with running(tmp_path, line(4, CLOSE) + DISK) as world:
        shell(world, "line-1", DELETED)
        shell(world, "line-2", MOVED)
        assert reaches(world, "line-0", "line-3")
        for robot in ("line-1", "line-2"):
            assert world.on("line-0", "ping", "-c", "1", "-W", "0.5", world.address(robot)).returncode != 0
        summary = world.end()
    assert summary["ended"] == "interrupted"
    assert summary["counts"]["interfaces_lost"] == 2
    assert summary["counts"]["frames_refused_by_device"] > 0
    events = sorted((event["do"], *event["robots"]) for event in summary["events"])
    assert events == [("interface_lost", "line-1"), ("interface_lost", "line-2")]


def test_beacons_reach_groups_without_an_interface_also_after_changes(tmp_path):
    changes = (
        "true",
        "ip link set radio0 down; ip link set radio0 up",
        f"ip addr flush dev radio0; ip addr add {SENDER}/16 dev radio0",
        "ip link set radio0 down; ip link set radio0 name mesh7; ip link set mesh7 up",
    )
    (tmp_path / "beacon.py").write_text(BEACON)
    receivers = "".join(f"{sys.executable} beacon.py {group} {len(changes)} & " for group in GROUPS)
    scenario = with_program(line(2, CLOSE), "sh", "-c", f"{receivers} wait") + DISK
    with running(tmp_path, scenario) as world:
        log = world.folder / "programs" / "line-1.log"
        until(lambda: log.exists() and log.read_text().count("ready") == len(GROUPS))
        for number, change in enumerate(changes, 1):
            shell(world, "line-0", change)
            until(lambda: "255.255.255.255" in shell(world, "line-0", "ip route"))
            for group in GROUPS:
                shell(world, "line-0", f"{sys.executable} {tmp_path}/beacon.py {group} send")
                until(lambda got=f"{group} {SENDER}\n", number=number: log.read_text().count(got) == number)
        world.end()


def test_addresses_survive_a_device_that_goes_down_and_up(tmp_path):
    with running(tmp_path, line(2, CLOSE) + DISK) as world:
        shell(world, "line-0", "ip link set radio0 down; ip link set radio0 up")
        for to in ("fe80::53:57ff:fe00:2%radio0", "fd53:57::2", world.address("line-1"), "line-1"):
            assert reaches(world, "line-0", to), to
        assert reaches(world, "line-1", "line-0")
        summary = world.end()
    assert "interfaces_lost" not in summary["counts"]


CHANGES = {  # by robot what it does to its device
    "line-1": "ip link set radio0 address 02:00:00:00:00:07; ping -c 1 -W 0.5 10.77.0.1 || true",
    "line-2": "ip link set radio0 down",
    "line-3": f"ip link set radio0 mtu 9000; {sys.executable} raw.py ffffffffffff 9000 0",
    "line-4": f"{sys.executable} raw.py ffffffffffff 1000 1",
    "line-5": "ip link set radio0 promisc on; ip addr flush dev radio0; ip route flush dev radio0; kill -9 1",
}


def test_changes_of_devices_are_counted_and_others_go_on(tmp_path):
    (tmp_path / "raw.py").write_text(RAW)
    with running(tmp_path, line(7, CLOSE) + DISK) as world:
        for robot, script in CHANGES.items():
            shell(world, robot, f"cd {tmp_path}; {script}")
        assert reaches(world, "line-0", "line-6")
        summary = world.end()
    assert summary["ended"] == "interrupted"
    counts = {**summary["counts"], **summary["radio"]["fates"]}
    expected = "frames_of_other_stations", "frames_refused_by_device", "too_large", "queue_full"
    assert {name for name in expected if not counts.get(name)} == set()


def test_frames_to_an_address_of_no_robot_take_airtime_and_are_counted(tmp_path):
    (tmp_path / "raw.py").write_text(RAW)
    options = "--links", "--packets", "all"
    with running(tmp_path, line(2, CLOSE) + DISK.replace("queue_limit = 200", "queue_limit = 8"), *options) as world:
        for to in ("0a0b0c0d0e0f", "025357000009"):
            shell(world, "line-0", f"{sys.executable} {tmp_path}/raw.py {to} 1486 0.5")
        assert reaches(world, "line-0", "line-1")
        world.end()
    summary = json.loads((world.folder / "summary.json").read_text())
    robots = RunFolder(world.folder).radio_robots()
    # In each half second 1,500 bytes after the other at 6 Mbit/s, 2 ms each, as far as this machine keeps up.
    assert summary["counts"]["packets_to_nobody"] > robots["packets_on_air"][0] > 20
    assert robots["airtime_s"][0] > 0.002 * (robots["packets_on_air"][0] - 20)
    assert sum(summary["radio"]["fates"].values()) == summary["radio"]["intended"]
    assert swarmwire("verify", world.folder).returncode == 0

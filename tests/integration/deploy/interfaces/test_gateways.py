"""Gateways within robots' namespaces: programs on a robot drive it, and nothing else."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

from swarmwire.deploy import run
from swarmwire.metrics.records.run_folder.reader import RunFolder
from tests.support.clocks import until
from tests.support.deploy.interfaces import DISK, STILL, line, needs_interfaces, running, with_program
from tests.support.refusals import refused_input

pytestmark = needs_interfaces

# As GCtronic's page on the e-puck2 says it: 21 bytes go out, a header and 104 bytes come back.
EPUCK2_DRIVER = """
import os, socket, struct

host, port = os.environ["ROBOT_GATEWAY"].split(":")
turn = struct.pack("<BBB", 0x80, 0x02, 0x00) + struct.pack("<hh", -300, 300) + bytes(14)
with socket.create_connection((host, int(port)), timeout=20) as link:
    while True:
        link.sendall(turn)
        packet = b""
        while len(packet) < 105:
            packet += link.recv(105 - len(packet))
        print(len(packet), flush=True)
"""
# A session as rmw_zenoh's nodes have it: a peer that looks for the router of its machine.
ROS2_SESSION = """
import json, os, sys, time
import zenoh

def session(endpoint):
    config = {"mode": "peer", "connect": {"endpoints": [endpoint]}, "scouting": {"multicast": {"enabled": False}}}
    return zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
"""
ROS2_NODE = """
from session import os, session, time
from swarmwire.comms.protocols.ros2.keys import bridge_key
from swarmwire.comms.protocols.ros2.messages import Velocities, encode_twist

TURN = Velocities(linear_mps=0.0, angular_radps=1.5, lateral_mps=0.0)
robot = os.environ["ROBOT"]
node = session("tcp/localhost:7447")
here = node.liveliness().declare_token(f"node_of/{robot}")
print("at", os.environ["ROBOT_GATEWAY"], flush=True)
while True:
    node.put(bridge_key("/" + robot.replace("-", "_") + "/cmd_vel"), encode_twist(TURN))
    time.sleep(0.05)
"""
ROS2_LOOK = """
from session import session, sys

node = session("tcp/localhost:7447")
print(*sorted(str(reply.ok.key_expr) for reply in node.liveliness().get(sys.argv[1]) if reply.ok))
node.close()
"""


def driven(robots: int, *program: str, seconds: int = 3600) -> str:
    """A scenario of robots in a line that run a program."""
    return with_program(line(robots), *program).replace("3600", str(seconds)) + DISK


def turned_rad(folder: Path) -> np.ndarray:
    """The largest angle between each robot's heading and that at the start, (robots,)."""
    return abs(np.array(RunFolder(folder).ticks()["heading_rad"].to_list())).max(axis=0)


def test_program_drives_its_robot_through_the_gateway_in_its_namespace(tmp_path):
    scenario = driven(2, sys.executable, "driver.py", seconds=3)
    with running(tmp_path, scenario, "--gateway", "epuck2", files={"driver.py": EPUCK2_DRIVER}) as world:
        assert world.process.wait(60) == 0
    assert (turned_rad(world.folder) > 0.5).all(), world.output("line-0")
    assert world.output("line-1").startswith("105\n")


def test_ros_nodes_find_the_router_of_their_robot_and_no_node_of_another(tmp_path):
    pytest.importorskip("rosbags", reason="needs the extra [ros2]")
    files = {"session.py": ROS2_SESSION, "node.py": ROS2_NODE, "look.py": ROS2_LOOK}
    scenario = driven(2, sys.executable, "node.py")
    with running(tmp_path, scenario, "--gateway", "ros2", files=files) as world:
        for robot in world.robots:
            until(lambda robot=robot: world.output(robot) == "at tcp/127.0.0.1:7447\n")
        look = [sys.executable, str(tmp_path / "look.py")]
        for own, other in (("line_0", "line_1"), ("line_1", "line_0")):
            robot = own.replace("_", "-")
            until(lambda robot=robot: world.on(robot, *look, "node_of/*").stdout == f"node_of/{robot}\n")
            output = world.on(robot, *look, "@ros2_lv/**").stdout
            assert f"%{own}" in output
            assert other not in output
        world.end()
    assert (turned_rad(world.folder) > 0.5).all(), world.output("line-0")


@pytest.mark.parametrize(
    ("address", "expected"),
    [
        ("unixsock-stream/router", "ros2: address: expected an address such as tcp/127.0.0.1:7447 on robots with"),
        ("tcp/192.0.2.7:7447", "gateways: expected an address that robots have"),
    ],
)
def test_gateway_address_that_no_robot_can_have_is_refused(tmp_path, address, expected):
    pytest.importorskip("rosbags", reason="needs the extra [ros2]")
    (tmp_path / "still.py").write_text(STILL)
    (tmp_path / "scenario.toml").write_text(driven(1, "true") + "[radio.interface]")
    with refused_input(match=re.escape(expected)):
        run(tmp_path / "scenario.toml", gateways=f"ros2@{address}")

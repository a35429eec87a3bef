"""A program that knows nothing of swarmwire drives an e-puck2 of a run, by sockets and bytes alone."""

import subprocess
import sys

import pytest

from swarmwire.deploy import Simulation
from tests.support.deploy.commands import ROOT

# As GCtronic's page on the e-puck2 says it: 21 bytes go out, a header and 104 bytes come back.
PROGRAM = """
import socket, struct, sys

host, port = sys.argv[1].split(":")
TURN_LEFT = struct.pack("<BBB", 0x80, 0x02, 0x00) + struct.pack("<hh", -300, 300) + bytes(14)

def packet(link):
    data = b""
    while len(data) < 105:
        got = link.recv(105 - len(data))
        if not got:
            sys.exit("the robot hung up")
        data += got
    return data

with socket.create_connection((host, int(port)), timeout=20) as link:
    right = 0
    while right < 90:
        link.sendall(TURN_LEFT)
        answer = packet(link)
        left, right = struct.unpack_from("<hh", answer, 1 + 79)
    print(answer[0], left, right)
"""


def test_a_program_of_plain_sockets_turns_a_robot(tmp_path) -> None:
    scenario = ROOT / "scenarios" / "robots" / "avoidance-epuck2.toml"
    with Simulation(scenario, gateways="epuck2", overrides=["robots.wanderers.count=2"], realtime=20) as simulation:
        assert simulation.served is not None
        address = simulation.served.robots[1].address
        program = subprocess.Popen(
            [sys.executable, "-I", "-c", PROGRAM, address], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        before = simulation.world.pose[:, 2].copy()
        while program.poll() is None and simulation.tick < 2000:
            simulation.step()
        out, errors = program.communicate(timeout=20)
        simulation.run(simulation.tick + 3)  # the connection is gone
        turned = simulation.world.velocity[:, 2]
    assert not errors, errors
    header, left, right = map(int, out.split())
    assert header == 0x02
    assert left == pytest.approx(-right, abs=20)
    assert turned[0] == 0.0
    assert before[0] == simulation.world.pose[0, 2]
    # 300 steps/s of 0.12566 mm on either wheel, 53 mm apart: it goes on as it was told, as the firmware does.
    assert turned[1] == pytest.approx(2 * 300 * 0.12566e-3 / 0.053, rel=0.05)

"""Frames of robots' interfaces in captures, tables and counters."""

import json
import subprocess
import sys
from collections import Counter

import polars as pl
import pytest

from swarmwire.metrics.records.run_folder.reader import RunFolder
from tests.support.deploy.interfaces import DISK, line, needs_interfaces, needs_program, running
from tests.support.deploy.runs import swarmwire

pytestmark = needs_interfaces
PINGS = 3
WITH_SIGNAL = '[radio]\npreset = "{}"\nfrequency_hz = {}\n'
RADIOS = {
    "unit-disk": DISK,
    "wifi-a-6M": WITH_SIGNAL.format("wifi-a-6M", 5.18e9),
    "ieee802154": WITH_SIGNAL.format("ieee802154", 2.44e9),
}
# A configuration BPDU (IEEE 802.1D, 9.3.1): Ethernet with a length, then LLC without SNAP.
SPANNING_TREE = """
import socket

station = bytes.fromhex("025357000001")
bridge = bytes.fromhex("8000") + station
bpdu = bytes(5) + bridge + bytes(4) + bridge + bytes.fromhex("8001 0000 1400 0200 0f00")
device = socket.socket(socket.AF_PACKET, socket.SOCK_RAW)
device.bind(("radio0", 0))
device.send(bytes.fromhex("0180c2000000") + station + bytes.fromhex("0026 424203") + bpdu)
"""
CHATTER = """
from swarmwire.agent import Agent, Message, Robot, u4

class Count(Message):
    tick: u4

class Chatter(Agent):
    def __init__(self) -> None:
        self.tick = 0

    def step(self, robot: Robot) -> None:
        self.tick += 1
        robot.radio.send(Count(tick=self.tick))
"""


@needs_program("ping", "tshark")
@pytest.mark.parametrize("radio", RADIOS)
def test_capture_has_frames_that_tshark_dissects_beside_messages(tmp_path, radio):
    scenario = line(2).replace("still.py:Still", "chatter.py:Chatter") + RADIOS[radio]
    options = ("--packets", "all", "--links", "--set", "duration_s=6")
    with running(tmp_path, scenario, *options, files={"chatter.py": CHATTER}) as world:
        assert world.on("line-0", sys.executable, "-c", SPANNING_TREE).returncode == 0
        ping = world.on("line-0", "ping", "-c", str(PINGS), "-i", "0.2", "-s", "32", world.address("line-1"))
        assert world.process.wait(60) == 0
    summary = json.loads((world.folder / "summary.json").read_text())
    assert ping.returncode == 0, ping.stdout
    assert swarmwire("export", world.folder, "--to", tmp_path / "t.pcapng").returncode == 0
    fields = ("_ws.malformed", "icmp.type", "arp.opcode", "stp.root.hw")
    command = ["tshark", "-r", str(tmp_path / "t.pcapng"), "-T", "fields"]
    command += [word for name in fields for word in ("-e", name)]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    rows = [row.split("\t") for row in ended.stdout.splitlines()]
    assert {row[0] for row in rows} == {""}
    assert Counter(row[1] for row in rows if row[1]) == {"8": PINGS, "0": PINGS}
    assert {row[2] for row in rows if row[2]} == {"1", "2"}
    assert [row[3] for row in rows if row[3]] == ["02:53:57:00:00:01"]
    packets = RunFolder(world.folder).packets().unique(["sender", "sequence"])
    frames = packets.filter(pl.col("topic") == "frame")
    assert len(packets) == len(rows)
    assert 0 < len(frames) < len(packets)
    assert frames["size_bytes"].sum() <= summary["interfaces"]["sent_bytes"]
    links = RunFolder(world.folder).radio_links().filter(fate="received")
    assert links["packets"].sum() == RunFolder(world.folder).packets().filter(fate="received").height

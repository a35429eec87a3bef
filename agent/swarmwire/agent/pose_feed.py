"""Publish poses of robots like a tracker: `python -m swarmwire.agent.pose_feed SWARM ENDPOINT … --certs FOLDER`.

A camera system's program prints a line `NAME X_M Y_M HEADING_RAD` per robot and frame into its standard input.
"""

# zenoh's stubs leave out the return type of put.
# pyright: reportUnknownMemberType=false

import argparse
import math
import sys
from collections.abc import Iterable
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import zenoh

from swarmwire.comms.base.clock import WallClock, to_ns
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.printable import LINES, printable
from swarmwire.comms.wire.keys import SwarmKeys
from swarmwire.comms.wire.network import Network, as_options
from swarmwire.comms.wire.radio_bridge import Pose, encode_pose
from swarmwire.comms.wire.robot_network import open_swarm

LINK_TIMEOUT_S = 5.0  # then only agents that do not run lack a link
POLL_NS = to_ns(0.05)
WHERE = "pose_feed"


def main(words: list[str] | None = None) -> int:
    """Publish the lines of the standard input until it ends; return the exit code, 1 if no agent listens."""
    parser = argparse.ArgumentParser(prog="python -m swarmwire.agent.pose_feed", description=__doc__)
    parser.add_argument("swarm", help="the swarm's name")
    parser.add_argument("endpoints", nargs="+", metavar="ENDPOINT", help="where each agent listens")
    parser.add_argument("--certs", type=Path, metavar="FOLDER", help="with ca.pem, tracker.pem and tracker.key")
    parser.add_argument("--insecure", action="store_true", help="go without certificates beyond this machine")
    parsed = parser.parse_args(words)
    try:
        network = _network(tuple(parsed.endpoints), parsed.certs, insecure=parsed.insecure)
        with closing(open_swarm(network)) as session:
            return _feed(session, parsed.swarm, len(parsed.endpoints), sys.stdin)
    except BadInput as error:
        sys.stderr.write(f"{printable(str(error), keep=LINES)}\n")
        return 2


def _network(endpoints: tuple[str, ...], certs: Path | None, *, insecure: bool) -> Network:
    network = Network(connect=endpoints, insecure=insecure)
    if certs:
        network = replace(network, ca=certs / "ca.pem", certificate=certs / "tracker.pem", key=certs / "tracker.key")
    try:
        network.check(WHERE)
    except BadInput as error:
        option = "ENDPOINT" if error.key == "network.connect" else "--certs"
        raise BadInput(WHERE, option, as_options(error.expected)) from None
    return network


def _feed(session: zenoh.Session, swarm: str, agents: int, lines: Iterable[str]) -> int:
    """Publish these lines once agents listen; return the exit code."""
    keys, clock = SwarmKeys(swarm), WallClock()
    any_robot = session.declare_publisher(keys.any_pose)
    end_ns, linked = clock.now_ns() + to_ns(LINK_TIMEOUT_S), 0
    while linked < agents and clock.now_ns() < end_ns:
        clock.sleep_until(clock.now_ns() + POLL_NS)
        linked = len(session.info.peers_zid()) if any_robot.matching_status else 0
    if not linked:
        sys.stderr.write(f"no agent listens for poses of {swarm!r}: expected agents with tracker = true and this CA\n")
        return 1
    sys.stderr.write(f"linked with {linked} of {agents}\n")
    for line in lines:
        pose = _parse_pose(line)
        if pose is None:
            sys.stderr.write(f"expected NAME X_M Y_M HEADING_RAD, got {line.strip()!r}\n")
        else:
            session.put(keys.pose(line.split()[0]), encode_pose(pose, clock.utc_ns()))
    return 0


def _parse_pose(line: str) -> Pose | None:
    """Return the pose in a line, or None."""
    try:
        _, *numbers = line.split()
        x_m, y_m, heading_rad = map(float, numbers)
    except ValueError:
        return None
    return Pose(x_m, y_m, heading_rad) if all(map(math.isfinite, (x_m, y_m, heading_rad))) else None


if __name__ == "__main__":
    sys.exit(main())

"""The `robot.toml` of each robot: its settings, and its place in the swarm's network."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from swarmwire.deploy.fleet.fleet import Fleet, Robot

LOG = "../../log"  # beside the folder of releases: logs outlive them
CA, SETTINGS_FILE = "ca.pem", "robot.toml"


def robot_settings(fleet: Fleet, robot: Robot, revoked: Sequence[str]) -> dict[str, Any]:
    """The content of a robot's `robot.toml`; files are beside it."""
    return {
        "format": 1,
        "name": robot.name,
        "swarm": fleet.swarm,
        "robots": [other.name for other in fleet.robots],
        **robot.settings,
        "agent": _beside(robot.settings["agent"]),
        **({"body": _beside(robot.settings["body"])} if "body" in robot.settings else {}),
        "network": _network(fleet, robot, revoked),
        "log": LOG,
    }


def operator_network(fleet: Fleet, revoked: Sequence[str], robots: Sequence[Robot]) -> dict[str, Any]:
    """The network of whoever asks these robots from here; its files are in the fleet's folder of certificates."""
    connect = [robot.endpoint for robot in robots]
    if fleet.certificates is None:
        return {"connect": connect, "insecure": True}
    return {"connect": connect, **_proof(fleet, fleet.operator, revoked)}


def _network(fleet: Fleet, robot: Robot, revoked: Sequence[str]) -> dict[str, Any]:
    protocol, _, address = robot.endpoint.partition("/")
    network: dict[str, Any] = {
        "listen": [f"{protocol}/0.0.0.0:{address.rpartition(':')[2]}"],
        # One of each two calls: both would have them meet twice, and one link be closed again.
        "connect": [other.endpoint for other in fleet.robots[: fleet.robots.index(robot)]],
    }
    if not network["connect"]:
        del network["connect"]
    if fleet.certificates is None:
        return {**network, "insecure": True}
    return {**network, **_proof(fleet, robot.name, revoked)}


def _proof(fleet: Fleet, name: str, revoked: Sequence[str]) -> dict[str, Any]:
    proof: dict[str, Any] = {"ca": CA, "certificate": f"{name}.pem", "key": f"{name}.key", "operator": fleet.operator}
    return {**proof, "revoked": list(revoked)} if revoked else proof


def _beside(name: str) -> str:
    """A file's name in the folder of the settings, to which it is copied; what is no file stays as it is."""
    place, colon, inner = name.rpartition(":")
    if colon and place.endswith(".py"):
        return f"{Path(place).name}:{inner}"
    return Path(name).name if name.endswith(".toml") else name

"""The robots of a run that answer as real ones, from the first address to the last: gateways, network, tracker, air."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from swarmwire.world.gateways.backend import GatewayGroup
from swarmwire.world.gateways.radio_bridge import RadioBridge


@dataclass(frozen=True)
class ServedRobot:
    """A robot of a run that answers as a real one."""

    name: str
    kind: str  # of its gateway, and of the driver that speaks with it
    address: str  # as that driver takes it
    settings: Mapping[str, Any]  # of `swarmwire-agent`, as in `robot.toml`
    file: Path | None  # where these are written, if the run has a folder


@dataclass(frozen=True)
class Served:
    """All of them, ready to answer."""

    groups: tuple[GatewayGroup, ...]
    robots: tuple[ServedRobot, ...]
    medium: RadioBridge | None
    show: Callable[[], None]  # tells where all robots are
    show_counts: Callable[[], dict[str, int]]  # what of that nobody was told
    swarm: str
    endpoints: tuple[str, ...]  # of the network

"""What a robot's log says of the robot: robot.json, read and checked."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any, cast

from swarmwire.comms.bodies.body import Body, body_from_mapping
from swarmwire.comms.config import check_format, from_json
from swarmwire.comms.errors import BadInput

LOG_FORMAT = 1
ROBOT = "robot.json"


@dataclass(frozen=True)
class AboutRobot:
    """robot.json, as far as it is read."""

    name: str
    swarm: str
    robots: tuple[str, ...]  # all of the swarm, in the order of their index
    agent: str  # as the robot's settings have it
    agent_sha256: str
    params: Mapping[str, Any]
    body: Body
    rate_hz: float
    started_utc_ns: int
    radio_kind: str  # "world": the packets went over a run's radio


def read_about_robot(path: Path) -> AboutRobot:
    """What the file says; BadInput if it is none, is damaged, or is of another format."""
    try:
        found: object = from_json(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise BadInput(str(path.parent), path.name, "expected a robot's log: the file is missing") from None
    except (OSError, ValueError) as error:
        raise BadInput(str(path), "", f"expected what a robot says of itself: {error}") from None
    if not isinstance(found, dict):
        raise BadInput(str(path), "", "expected an object")
    told = cast("dict[str, Any]", found)
    check_format(told, LOG_FORMAT, str(path))
    return _about(told, str(path))


def _about(told: dict[str, Any], where: str) -> AboutRobot:
    def get(name: str, kind: type | tuple[type, ...], expected: str) -> Any:
        value = told.get(name)
        if not isinstance(value, kind) or isinstance(value, bool):
            raise BadInput(where, name, f"expected {expected}")
        return value

    names: list[Any] = get("robots", list, "a list of names")
    if not all(isinstance(name, str) for name in names) or len(set(names)) < len(names):
        raise BadInput(where, "robots", "expected a list of names, each once")
    name = get("name", str, "a name")
    if name not in names:
        raise BadInput(where, "name", f"expected one of robots, got {name!r}")
    rate_hz = float(get("rate_hz", (int, float), "a rate in Hz"))
    if not (isfinite(rate_hz) and rate_hz > 0.0):
        raise BadInput(where, "rate_hz", f"expected more than 0 Hz, got {rate_hz:g}")
    radio: dict[str, Any] = get("radio", dict, "an object")
    if not isinstance(radio.get("kind"), str):
        raise BadInput(where, "radio.kind", "expected a text")
    return AboutRobot(
        name=name,
        swarm=get("swarm", str, "the swarm's name"),
        robots=tuple(names),
        agent=get("agent", str, "the agent's class"),
        agent_sha256=get("agent_sha256", str, "a digest"),
        params=get("params", dict, "an object"),
        body=body_from_mapping(get("body", dict, "a body's sheet"), where),
        rate_hz=rate_hz,
        started_utc_ns=get("started_utc_ns", int, "whole nanoseconds since 1970"),
        radio_kind=radio["kind"],
    )

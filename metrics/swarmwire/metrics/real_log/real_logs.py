"""The logs of a swarm of real robots: a folder with one for each, or the folder of a single one."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

from swarmwire.comms.errors import BadInput
from swarmwire.metrics.real_log.about import ROBOT
from swarmwire.metrics.real_log.log_folders import log_folders, newest_starts
from swarmwire.metrics.real_log.robot_log import RobotLog, read_robot_log

NAMED = 4  # robots that are named in a line, at most


@dataclass(frozen=True)
class RealLogs:
    """What was read, and what is amiss with it."""

    where: str
    robots: tuple[RobotLog, ...]  # in the order of their index
    notes: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Of the robots of which there are logs."""
        return tuple(robot.name for robot in self.robots)

    @property
    def rate_hz(self) -> float:
        """Steps of each robot per second."""
        return self.robots[0].about.rate_hz


def read_real_logs(path: Path) -> RealLogs:
    """The logs in this folder, of each robot that of its newest start.

    BadInput for what is no log, and for robots of different swarms or rates.
    """
    if not path.is_dir():
        raise BadInput(str(path), "", "expected a folder of robots' logs: there is none")
    folders, older = newest_starts(log_folders(path))
    if not folders:
        raise BadInput(str(path), "", f"expected robots' logs: it holds no folder with a {ROBOT}")
    robots = [read_robot_log(folder) for folder in folders]
    _refuse_strangers(robots)
    place = {name: i for i, name in enumerate(robots[0].about.robots)}
    robots.sort(key=lambda robot: place[robot.name])
    return RealLogs(str(path), tuple(robots), (*_earlier(older, path), *_notes(robots)))


def _refuse_strangers(robots: Sequence[RobotLog]) -> None:
    """BadInput unless all are of one swarm and of one rate, each there once."""
    first, names = robots[0], dict[str, str]()
    for robot in robots:
        where = f"{robot.where}/{ROBOT}"
        for key in ("swarm", "robots", "rate_hz"):
            own, others = getattr(robot.about, key), getattr(first.about, key)
            if own != others:
                raise BadInput(where, key, f"expected that of {first.where}, {_text(others)}; got {_text(own)}")
        if robot.name in names:
            raise BadInput(where, "name", f"expected another robot than in {names[robot.name]}; got {robot.name!r}")
        names[robot.name] = robot.where


def _earlier(older: Sequence[Path], path: Path) -> list[str]:
    left_out = named([str(folder.relative_to(path)) for folder in older])
    return [f"earlier starts are left out, of each robot all but the newest: {left_out}"] if older else []


def _text(value: object) -> str:
    if isinstance(value, tuple):
        return ", ".join(map(str, cast("tuple[object, ...]", value)))
    return str(value)


def _notes(robots: Sequence[RobotLog]) -> list[str]:
    there = {robot.name for robot in robots}
    missing = [name for name in robots[0].about.robots if name not in there]
    killed = [robot.name for robot in robots if robot.ended is None]
    notes: list[str] = []
    if missing:
        notes.append(f"no log of {named(missing)}: packets to and from there are left out")
    if killed:
        notes.append(f"no summary of {named(killed)}: killed, or still going on")
    notes += [
        f"half a line at the end of {robot.name}'s {', '.join(robot.half_lines)} was dropped"
        for robot in robots
        if robot.half_lines
    ]
    agents = {(robot.about.agent, robot.about.agent_sha256) for robot in robots}
    if len(agents) > 1:
        notes.append(f"{len(agents)} different agents: {named(sorted(agent for agent, _ in agents))}")
    if len({str(robot.about.params) for robot in robots}) > 1:
        notes.append("the robots' params differ")
    return notes


def named(names: Sequence[str]) -> str:
    """The first few of some names, and how many there are more.

    >>> named(["a", "b"]), named(["a", "b", "c", "d", "e"])
    ('a, b', 'a, b, c, d and 1 more')
    """
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return ", ".join(names[:NAMED]) + more

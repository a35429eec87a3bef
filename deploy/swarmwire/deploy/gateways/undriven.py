"""Robots behind gateways that nobody drives: told soon after the start, and at the end."""

from collections.abc import Callable
from shlex import quote
from typing import Any

from swarmwire.comms.clock import to_s
from swarmwire.comms.interfaces import Observer
from swarmwire.comms.truth import PacketCounts, Truth
from swarmwire.deploy.gateways.serving import Served, ServedRobot

GRACE_S = 10.0  # wall time after the start, by which people have begun to drive what they mean to
NAMED = 6  # robots, at most


class Undriven(Observer):
    """Observer that tells people which robots no program has told how to move: a run in which they stand still."""

    def __init__(self, served: Served, pace: float, say: Callable[[str], None]) -> None:
        """`pace` is of the run, in simulated seconds per second of wall time."""
        self._served, self._pace, self._say = served, pace, say
        self._told = False

    def see(self, truth: Truth) -> None:
        """Tell of them once, when they could be driven."""
        if not self._told and to_s(truth.time_ns) >= GRACE_S * self._pace:
            self._told = True
            self._tell("nobody drives")

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Tell of those that nobody drove at all."""
        self._tell("nobody drove")
        return {}

    def _tell(self, verb: str) -> None:
        robots = self._robots()
        if not robots:
            return
        more = len(robots) - NAMED
        names = ", ".join(robot.name for robot in robots[:NAMED]) + (f" and {more} more" if more > 0 else "")
        file = robots[0].file
        command = f": swarmwire-agent run --config {quote(str(file))}" if file else ""
        self._say(f"{verb} {names}{command}{' and so on' if file and len(robots) > 1 else ''}")

    def _robots(self) -> list[ServedRobot]:
        """Those that no program has driven; the served are in the order of their groups."""
        driven = [bool(driven) for group in self._served.groups for driven in group.driven]
        return [robot for robot, moved in zip(self._served.robots, driven, strict=True) if not moved]

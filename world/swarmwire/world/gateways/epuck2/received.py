"""What programs told a group of emulated e-puck2s, kept until the loop asks."""

from collections import Counter
from threading import Lock

import numpy as np

from swarmwire.comms.bodies.body import Body
from swarmwire.comms.robots.epuck2.commands import FASTEST, RobotCommand, body_speeds
from swarmwire.comms.robots.epuck2.packets import Settings
from swarmwire.comms.tick_io import LedChanges
from swarmwire.world.gateways.gateway import Commands


class Received:
    """The newest speeds of each robot, its LEDs, and its step counters; any thread may add to them."""

    def __init__(self, robots: int, body: Body, counts: Counter[str]) -> None:
        self._robots, self._wheel_base_m, self._counts = robots, body.wheels.wheel_base_m, counts
        self._lock = Lock()
        self._speeds: dict[int, tuple[float, float]] = {}
        self._leds: dict[tuple[int, int], int] = {}  # robot and place -> 0xRRGGBB
        self._counters: dict[int, tuple[int, int]] = {}
        self._shown = [dict.fromkeys(range(body.led_count), 0) for _ in range(robots)]

    def add(self, robot: int, command: RobotCommand) -> None:
        """Keep what a robot is told."""
        with self._lock:
            if command.settings & Settings.AVOID:
                self._counts["avoidance_refused"] += 1  # it goes as it is told
            if command.settings & Settings.SET_STEPS:
                self._counters[robot] = command.left, command.right
            else:
                if max(abs(command.left), abs(command.right)) > FASTEST:
                    self._counts["speeds_clipped"] += 1
                self._speeds[robot] = body_speeds(command.left, command.right, self._wheel_base_m)
            before = self._shown[robot]
            if before:
                shown = command.lights.shown(before)
                self._leds.update({(robot, which): rgb for which, rgb in shown.items() if rgb != before[which]})
                self._shown[robot] = shown

    def halt(self, robot: int) -> None:
        """Keep that a robot was switched on: at rest, and dark."""
        self.add(robot, RobotCommand())

    def counters(self) -> dict[int, tuple[int, int]]:
        """What step counters were to show, by robot, since the last call."""
        with self._lock:
            counters, self._counters = self._counters, {}
        return counters

    def taken(self) -> Commands:
        """What came since the last call."""
        with self._lock:
            speeds, self._speeds = self._speeds, {}
            leds, self._leds = self._leds, {}
        drive, linear_mps, angular_radps = np.zeros(self._robots, bool), *np.zeros((2, self._robots))
        for robot, (linear, angular) in speeds.items():
            drive[robot], linear_mps[robot], angular_radps[robot] = True, linear, angular
        changes = np.array([(*at, rgb) for at, rgb in leds.items()], np.int64).reshape(-1, 3).T
        lateral_mps = np.zeros(self._robots)
        return Commands(drive, linear_mps, angular_radps, lateral_mps, LedChanges(*changes.copy()))

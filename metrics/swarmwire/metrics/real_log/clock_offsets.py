"""How far apart the robots' clocks are, by the packets that went both ways between them.

A packet takes at least as long one way as the other, and a clock that is ahead makes what it hears late and what it
sends early: half the difference of the shortest latencies is the clocks' (as NTP has it, RFC 5905, section 8).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.real_log.real_logs import RealLogs, named
from swarmwire.metrics.real_log.robot_log import RobotLog

APART_S = 0.005  # from which on it is worth a word, and is taken out
FEWEST = 20  # packets each way
SHORT = 0.05  # the quantile that stands for the shortest: a single one may be a clock that was set


def clock_offsets_s(robots: Sequence[RobotLog]) -> FloatArray:
    """How far each robot's clock is ahead of the swarm's median in s, (robots,); 0 where nothing tells."""
    place = {robot.name: i for i, robot in enumerate(robots)}
    short_s: dict[tuple[int, int], float] = {}
    for receiver, robot in enumerate(robots):
        for sender, received in robot.received.by_sender.items():
            known = received.latency_s[np.isfinite(received.latency_s)]
            if sender in place and len(known) >= FEWEST:
                short_s[place[sender], receiver] = float(np.quantile(known, SHORT))
    pairs = [(a, b) for a, b in short_s if a < b and (b, a) in short_s]
    if not pairs:
        return np.zeros(len(robots))
    ahead = np.zeros((len(pairs), len(robots)))
    half_s = np.array([0.5 * (short_s[a, b] - short_s[b, a]) for a, b in pairs])
    for row, (a, b) in enumerate(pairs):
        ahead[row, [a, b]] = -1.0, 1.0
    offsets_s: FloatArray = np.linalg.lstsq(ahead, half_s, rcond=None)[0].astype(np.float64)
    return offsets_s - np.median(offsets_s)


def in_step(logs: RealLogs) -> RealLogs:
    """The logs by one clock, with a note, if the clocks are apart so far that it matters; else as they are."""
    offsets_s = clock_offsets_s(logs.robots)
    apart = np.abs(offsets_s) > APART_S
    if not apart.any():
        return logs
    by_name = dict(zip(logs.names, offsets_s.tolist(), strict=True))
    told = [f"{name} {by_name[name]:+.3f} s" for name in sorted(by_name, key=lambda name: -abs(by_name[name]))]
    spread_s = float(np.ptp(offsets_s))
    note = (
        f"clocks up to {spread_s:.3g} s apart, by packets that went both ways "
        f"({named(told[: int(apart.sum())])} beside the median): taken out of times and latencies"
    )
    robots = tuple(_moved(robot, by_name) for robot in logs.robots)
    return replace(logs, robots=robots, notes=(*logs.notes, note))


def _moved(robot: RobotLog, offset_s: dict[str, float]) -> RobotLog:
    own_s = offset_s[robot.name]
    of_senders_s = np.array([offset_s.get(name, 0.0) for name in robot.received.sender.tolist()])
    received = replace(
        robot.received,
        time_s=robot.received.time_s - own_s,
        latency_s=robot.received.latency_s - (own_s - of_senders_s),
    )
    return replace(
        robot,
        steps=replace(robot.steps, time_s=robot.steps.time_s - own_s),
        sent=replace(robot.sent, time_s=robot.sent.time_s - own_s),
        received=received,
    )

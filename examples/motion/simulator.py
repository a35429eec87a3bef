"""Another simulator: ten robots in a row drive apart and back, and say 20 times a second by UDP where they are.

    python simulator.py [ADDRESS:PORT] [SECONDS] [PERIOD_S]

It knows nothing of swarmwire: a datagram is one JSON object. See `udp.toml`.
"""

import json
import math
import socket
import sys
import time
from collections.abc import Iterator

ROBOTS, RATE_HZ = 10, 20
NEAR_M, FAR_M = 10.0, 70.0  # gap between neighbours


def gap_m(time_s: float, period_s: float) -> float:
    """Return the gap between neighbours: from NEAR_M to FAR_M and back within a period."""
    return NEAR_M + (FAR_M - NEAR_M) * (0.5 - 0.5 * math.cos(2.0 * math.pi * time_s / period_s))


def paced(seconds: float) -> Iterator[float]:
    """Yield the times of steps in s, each as it comes."""
    start_s = time.monotonic()
    for k in range(int(seconds * RATE_HZ)):
        time.sleep(max(0.0, start_s + k / RATE_HZ - time.monotonic()))
        yield k / RATE_HZ


def main(address: str = "127.0.0.1:9870", seconds: str = "300", period_s: str = "40") -> None:
    """Send the poses until the time is over."""
    host, _, port = address.rpartition(":")
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    for time_s in paced(float(seconds)):
        gap = gap_m(time_s, float(period_s))
        for robot in range(ROBOTS):
            pose = {"robot": f"row-{robot}", "x_m": (robot - 4.5) * gap, "y_m": 0.0, "z_m": 0.0, "heading_rad": 0.0}
            sender.sendto(json.dumps(pose).encode(), (host, int(port)))


if __name__ == "__main__":
    main(*sys.argv[1:])

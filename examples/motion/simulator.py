"""Another simulator: ten robots in a row drive apart and back, and say 20 times a second by UDP where they are.

    python simulator.py [ADDRESS:PORT] [SECONDS] [PERIOD_S]

It knows nothing of swarmwire: a datagram is one JSON object. See `udp.toml`.
"""

import json
import math
import socket
import sys
import time

ROBOTS, RATE_HZ = 10, 20
NEAR_M, FAR_M = 10.0, 70.0  # gap between neighbours


def main(address: str = "127.0.0.1:9870", seconds: str = "60", period_s: str = "40") -> None:
    """Send the poses until the time is over."""
    host, _, port = address.rpartition(":")
    sender, start_s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), time.monotonic()
    for k in range(int(float(seconds) * RATE_HZ)):
        time.sleep(max(0.0, start_s + k / RATE_HZ - time.monotonic()))
        wave = 0.5 - 0.5 * math.cos(2.0 * math.pi * k / RATE_HZ / float(period_s))
        gap_m = NEAR_M + (FAR_M - NEAR_M) * wave
        for robot in range(ROBOTS):
            pose = {"robot": f"row-{robot}", "x_m": (robot - 4.5) * gap_m, "y_m": 0.0, "z_m": 0.0, "heading_rad": 0.0}
            sender.sendto(json.dumps(pose).encode(), (host, int(port)))


if __name__ == "__main__":
    main(*sys.argv[1:])

"""iperf3's throughput over the distance of robots that another simulator moved, beside the closed form.

    python throughput.py RUN

See `throughput.toml`. A server says what it received in each second of its stream. The run's record says when the
stream began, and how far apart the robots were.
"""

import re
import sys
from pathlib import Path

import numpy as np

from swarmwire.metrics.records.run_folder.reader import RunFolder

SECOND = re.compile(r"([\d.]+)-([\d.]+) +sec .* ([\d.]+) Kbits/sec")
OFFERED_MBPS, DATAGRAM_BYTES, REACH_M, EXPONENT = 1.0, 500, 51.15, 3.0


def throughputs(run: Path) -> list[tuple[float, float, float]]:
    """Return the mean distance in m, and iperf3's throughput and the closed form's in Mbit/s, for each 10 m."""
    record = RunFolder(run)
    rate_hz, x_m = record.static.rate_hz, record.ticks()["x_m"].to_numpy()
    packets = record.packets()
    rows: list[tuple[float, float, float]] = []
    for server in range(1, x_m.shape[1], 2):
        stream = packets.filter((packets["sender"] == server - 1) & (packets["size_bytes"] > DATAGRAM_BYTES))
        if stream.is_empty():  # never connected
            continue
        start_s = float(stream["sent_at_ns"].to_numpy().min()) / 1e9
        log, _, _ = (run / "programs" / f"row-{server}.log").read_text().partition("- - -")  # its sum follows
        for from_s, to_s, rate_kbps in (map(float, line) for line in SECOND.findall(log)):
            first, last = round((start_s + from_s) * rate_hz), round((start_s + to_s) * rate_hz)
            gaps_m = x_m[first:last, server] - x_m[first:last, server - 1]
            if gaps_m.size:  # the last interval is what is left of a second
                expected = OFFERED_MBPS * float(np.exp(-((gaps_m / REACH_M) ** EXPONENT)).mean())
                rows.append((float(gaps_m.mean()), rate_kbps / 1e3, expected))
    values = np.array(rows)
    tens = values[:, 0] // 10
    return [tuple(values[tens == ten].mean(axis=0).tolist()) for ten in np.unique(tens)]


if __name__ == "__main__":
    print("distance  iperf3       closed form")
    for distance_m, measured_mbps, expected_mbps in throughputs(Path(sys.argv[1])):
        print(f"{distance_m:6.1f} m  {measured_mbps:.2f} Mbit/s  {expected_mbps:.2f} Mbit/s")

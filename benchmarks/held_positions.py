"""What it costs that positions are held for a tick, or interpolated: delivery at the edge of range, by speed and rate.

`python -m benchmarks.held_positions` prints the Markdown tables of docs/dev/validation.md. A robot drives away from
another, or towards it, and sends ten packets a second. The same packets, at the same times and with the same draws,
go over the radio with ticks of 1 ms, and with longer ones: frames see positions at the start of the tick in which
they go on air, or positions between two ticks. The second table has fading: the attempts at a packet of one tick have
the same gain, as long as positions are held.
"""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray
from swarmwire.comms.base.clock import NS_PER_S, tick_start_ns
from swarmwire.comms.base.draws import derive_key
from swarmwire.comms.base.geometry.obstacle_index import ObstacleIndices
from swarmwire.comms.base.geometry.obstacles import obstacle_arrays
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.radio.analysis.coverage import RadioCoverage
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.robot.packets import Payloads, SentPackets
from swarmwire.deploy.runs.scenario_parts import radio_of

RADIOS = {
    "unit disk of 50 m": ("unit-disk", ["radio.range_m=50"]),
    "802.15.4": ("ieee802154", []),
    "802.11a": ("wifi-a-6M", []),
}
FADING = ("ieee802154", ["radio.fading.distribution=rayleigh"])
FADING_M = 70.0  # where a lone frame has a delivery of 0.8
SPEEDS_MPS, REFERENCE_HZ = (1.0, 3.0, 10.0), 1000
CASES = (("held", 10), ("interpolated", 10), ("held", 100))  # positions, and ticks per second
LONGEST_TICK_S = 0.1
PAIRS, PACKETS, INTERVAL_S, PAYLOAD_BYTES = 3000, 10, 0.1, 20
NEAR_M = 1.0  # from the edge, to either side
STEP_M = 0.01  # at which the edge is looked for
QUIET_S = 0.2  # for packets that are still on their way


class Edge(NamedTuple):
    """Distances in m at which the delivery of lone packets falls below 0.99, 0.5 and 0.01."""

    near_m: float
    half_m: float
    far_m: float


def edge_of(radio: Radio, farthest_m: float = 500.0) -> Edge:
    """Where the delivery over distance falls."""
    key, nothing = np.uint64(derive_key("held positions", 0)), ObstacleIndices(obstacle_arrays(((),)), (1.0, 1.0), 0.0)
    distance_m = np.arange(STEP_M, farthest_m, STEP_M)
    ends = np.column_stack([distance_m, np.zeros(len(distance_m))])
    delivery = RadioCoverage(radio, key, nothing, PAYLOAD_BYTES).delivery(np.zeros_like(ends), ends)
    return Edge(*(float(distance_m[np.argmax(delivery < share)]) for share in (0.99, 0.5, 0.01)))


def drives(edge: Edge, speed_mps: float) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Drives across the edge: distances at their start in m (pairs,), send times in s (pairs, PACKETS), and speeds.

    The first half of the pairs drives apart, the other half towards each other, at `speed_mps` (pairs,). Distances at
    which packets are sent are uniform over the edge and 2 ticks' way around it. The last is their number per metre.
    """
    rng, way_m = np.random.default_rng(1), speed_mps * PACKETS * INTERVAL_S
    low_m, high_m = _distance_range(edge, speed_mps)
    share = (np.arange(PAIRS) + rng.uniform(0.0, 1.0, PAIRS)) / PAIRS
    apart_m = low_m - way_m + share * (high_m - low_m + way_m)
    start_m = np.concatenate([apart_m, apart_m + way_m])
    sent_s = INTERVAL_S * (np.arange(PACKETS) + rng.uniform(0.0, 1.0, (2 * PAIRS, PACKETS)))
    speeds_mps = np.repeat([speed_mps, -speed_mps], PAIRS)
    return start_m, sent_s, speeds_mps, PAIRS * PACKETS / (high_m - low_m + way_m)


def _distance_range(edge: Edge, speed_mps: float) -> tuple[float, float]:
    margin_m = NEAR_M + 2.0 * speed_mps * LONGEST_TICK_S
    return edge.near_m - margin_m, edge.far_m + margin_m


def received(
    radio: Radio, start_m: FloatArray, sent_s: FloatArray, speeds_mps: FloatArray, rate_hz: int, to: int = BROADCAST
) -> BoolArray:
    """Which packets of each pair are received with ticks of this rate, (pairs, PACKETS); `to` 1 is acknowledged."""
    pairs, delivered = len(start_m), np.zeros(sent_s.shape, np.bool_)
    keys = np.array([derive_key("held positions", pair) for pair in range(pairs)], np.uint64)
    size_m = 3.0 * float(start_m.max()), 2.0
    medium = RadioMedium(ChannelContext.open_space(radio, keys, 2, size_m), rate_hz)
    sent_at_ns = np.rint(sent_s * NS_PER_S).astype(np.int64)
    pose = np.zeros((pairs, 2, 3))
    for tick in range(int((PACKETS * INTERVAL_S + QUIET_S) * rate_hz)):
        at_ns, until_ns = tick_start_ns(tick, rate_hz), tick_start_ns(tick + 1, rate_hz)
        pose[:, 1, 0] = start_m + speeds_mps * (at_ns / NS_PER_S)
        got = medium.step(at_ns, pose.reshape(-1, 3).copy()).received
        delivered[got.receiver // 2, got.sequence] = True
        pair, packet = np.nonzero((at_ns <= sent_at_ns) & (sent_at_ns < until_ns))
        if len(pair):
            payloads = Payloads.from_rows([bytes(PAYLOAD_BYTES)] * len(pair))
            medium.send_at(sent_at_ns[pair, packet], SentPackets(2 * pair, np.full(len(pair), to), payloads))
    return delivered


def rows(name: str, speed_mps: float) -> Iterator[list[str]]:
    """A row of the table for each case."""
    preset, keys = RADIOS[name]
    radio = radio_of(preset, keys)
    edge = edge_of(radio)
    start_m, sent_s, speeds_mps, per_m = drives(edge, speed_mps)
    distance_m = start_m[:, None] + speeds_mps[:, None] * sent_s
    low_m, high_m = _distance_range(edge, speed_mps)
    counts = (distance_m >= low_m) & (distance_m < high_m)
    is_near = np.abs(distance_m - edge.half_m) <= NEAR_M
    exact = received(radio, start_m, sent_s, speeds_mps, REFERENCE_HZ)
    for positions, rate_hz in CASES:
        got = received(replace(radio, positions=positions), start_m, sent_s, speeds_mps, rate_hz)
        cells = [name, f"{speed_mps:g}", positions, f"{rate_hz}"]
        for way in (slice(None, PAIRS), slice(PAIRS, None)):
            more = got[way][counts[way]].sum() - exact[way][counts[way]].sum()
            near_got, near_exact = (which[way][is_near[way]].mean() for which in (got, exact))
            cells += [f"{near_exact:.2f}", f"{near_got:.2f}", f"{more / per_m:+.2f}"]
        yield cells


def faded(speed_mps: float) -> list[str]:
    """A row of the second table: delivery of broadcasts and of acknowledged packets in each case."""
    radio, cells = radio_of(*FADING), [f"{speed_mps:g}"]
    sent_s = INTERVAL_S * (np.arange(PACKETS) + np.random.default_rng(2).uniform(0.0, 1.0, (PAIRS, PACKETS)))
    drive = np.full(PAIRS, FADING_M), sent_s, np.full(PAIRS, speed_mps)
    for to in (BROADCAST, 1):
        for positions, rate_hz in (*CASES, ("held", REFERENCE_HZ)):
            cells.append(f"{received(replace(radio, positions=positions), *drive, rate_hz, to).mean():.2f}")
    return cells


def main() -> None:
    """Print the tables, each row as soon as it is known."""
    print("| radio | speed, m/s | `positions` | `rate_hz` | apart: at 1 kHz | with these | range, m ", end="")
    print("| together: at 1 kHz | with these | range, m |")
    print("| --- " * 10 + "|")
    for name in RADIOS:
        for speed_mps in SPEEDS_MPS:
            for cells in rows(name, speed_mps):
                print("| " + " | ".join(cells) + " |", flush=True)
    cases = " | ".join(f"{positions}, {rate_hz} Hz" for positions, rate_hz in (*CASES, ("held", REFERENCE_HZ)))
    print(f"\n| speed, m/s | broadcast: {cases} | acknowledged: {cases} |")
    print("| --- " * 9 + "|")
    for speed_mps in SPEEDS_MPS:
        print("| " + " | ".join(faded(speed_mps)) + " |", flush=True)


if __name__ == "__main__":
    main()

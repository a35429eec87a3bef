"""A configuration that both simulators run: its radio, its places and its send times."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray, KeyArray
from swarmwire.comms.base.clock import tick_start_ns
from swarmwire.comms.base.draws import derive_key, purpose, uniform
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.send_times import SendTimes
from swarmwire.deploy.runs.scenario_parts import radio_of

WARM_UP_S = 0.5
LATE_S = 0.6  # after the measured time, above the 0.5 s that a packet may wait
SPOT_M = 0.7  # side of the square in which distances do not count: below 1 m the loss is constant
POSITION_PURPOSE = purpose("place of validation")
EVER = 2**31 - 1
MODES = {"802.11a": "OfdmRate{}Mbps", "802.11b": "DsssRate{}Mbps", "802.11g": "ErpOfdmRate{}Mbps"}
MCS_MBPS = (6.5, 13.0, 19.5, 26.0, 39.0, 52.0, 58.5, 65.0)  # of 802.11n, 20 MHz, one stream, guard interval of 800 ns
RATE_CONTROLS = {"fixed": "ConstantRate", "ideal": "Ideal"}  # and what ns-3 calls them
MAX_AMPDU_BYTES = 65535
NEVER_BYTES = 4692480  # ns-3's default of RtsCtsThreshold, above every frame
# What ns-3 has by default where a preset has other values: loss at 1 m, power, no headers of IP and UDP; for 802.15.4
# noise and sensitivity of its ideal receiver, and a queue without end.
ALIKE = {
    "802.15.4": (
        "radio.queue_limit=1000000",
        "radio.noise.bandwidth_hz=5e6",
        "radio.noise.figure_db=0",
        "radio.reception.sensitivity_dbm=-106.58",
    ),
    "802.11": ("radio.overhead_bytes=36", "radio.antenna.power_dbm=16.0206"),
    "802.11n": ("radio.overhead_bytes=38", "radio.antenna.power_dbm=16.0206"),
}
PRESETS = {"802.11b": "wifi-b-1M", "802.11n": "wifi-n-5G"}


def radio_like_ns3(standard: str, rate_mbps: float, settings: Sequence[str] = ()) -> Radio:
    """A preset at this rate, with what ns-3 has by default, and these settings of 802.11."""
    loss = "radio.log_distance.reference_loss_db=46.6777"
    if standard == "802.15.4":
        return radio_of("ieee802154", [loss, *ALIKE[standard]])
    rate = f"radio.bit_rate_bps={round(1e6 * rate_mbps)}"
    alike = ALIKE.get(standard, ALIKE["802.11"])
    return radio_of(PRESETS.get(standard, "wifi-a-6M"), [loss, rate, f"radio.frame={standard}", *alike, *settings])


@dataclass(frozen=True)
class Configuration:
    """Nodes, where they are, and what they send; `seeds` independent runs with places and times of their own."""

    standard: str  # "802.15.4", "802.11a", "802.11b", "802.11g"
    rate_mbps: float
    nodes: int
    payload_bytes: int
    interval_s: float  # 1 / a whole number of Hz
    # All within 1 m; "area": at random in a square; "line": nodes 0 and 1 send, the last receives; "pairs": on a line,
    # the first half sends, each to a node of the second half.
    layout: str = "spot"
    # Of an area its side, of a line the distances of senders to the receiver, of pairs the place of each node.
    size_m: tuple[float, ...] = (SPOT_M,)
    unicast: bool = False  # to the next node, or within the pair, acknowledged; else to all
    is_mixed: bool = False  # every second node broadcasts
    is_saturated: bool = False  # senders always have a packet: what counts is the throughput
    seeds: int = 6
    measured_s: float = 2.0
    # Of 802.11n.
    rate_control: str = "fixed"  # else `rate_mbps` is the highest rate
    ampdu_bytes: int = MAX_AMPDU_BYTES  # the greatest A-MPDU; 0: no aggregation
    rts_bytes: int = NEVER_BYTES  # RTS/CTS precedes larger frames

    def as_mapping(self) -> dict[str, Any]:
        """What a record and a cache know it by."""
        return {**asdict(self), "size_m": list(self.size_m)}

    @property
    def radio(self) -> Radio:
        """The medium's radio."""
        settings = [
            f"radio.access.rate_control={self.rate_control}",
            f"radio.access.aggregation_bytes={self.ampdu_bytes}",
            *([f"radio.access.rts_threshold_bytes={self.rts_bytes}"] if self.has_rts else []),
        ]
        return radio_like_ns3(self.standard, self.rate_mbps, settings if self.standard == "802.11n" else ())

    @property
    def has_rts(self) -> bool:
        """Whether RTS/CTS precedes some frames."""
        return self.rts_bytes < NEVER_BYTES

    @property
    def where(self) -> str:
        """The places, and the receivers of packets, in words."""
        distances = ", ".join(f"{m:g}" for m in self.size_m)
        where = {
            "spot": "one spot",
            "line": f"{distances} m",
            "area": f"{distances} m square",
            "pairs": f"at {distances} m",
        }
        words = [where[self.layout]]
        words += ["mixed"] if self.is_mixed else ["unicast"] if self.unicast else []
        if self.ampdu_bytes != MAX_AMPDU_BYTES:
            words += [f"A-MPDU of {self.ampdu_bytes} bytes" if self.ampdu_bytes else "single frames"]
        words += ["RTS/CTS"] if self.has_rts else []
        return ", ".join(words)

    @property
    def cells(self) -> list[str]:
        """The first cells of its row."""
        interval_ms = f"{1e3 * self.interval_s:g}"
        return [
            f"{self.standard} {self.rate_control if self.rate_control != 'fixed' else f'{self.rate_mbps:g}M'}",
            str(self.nodes),
            str(self.payload_bytes),
            interval_ms,
            self.where,
        ]

    @property
    def rate_hz(self) -> int:
        return round(1.0 / self.interval_s)

    @property
    def senders(self) -> int:
        """Nodes 0 to this one, excluded, send."""
        return {"line": len(self.size_m), "pairs": self.nodes // 2}.get(self.layout, self.nodes)

    @property
    def ticks(self) -> int:
        """Packets that each sender hands over in all."""
        is_long = self.standard == "802.11n" and self.is_saturated  # thousands of packets, none of which would count
        late_s = 0.0 if is_long else LATE_S
        return round((WARM_UP_S + self.measured_s + late_s) * self.rate_hz)

    @property
    def counted(self) -> tuple[int, int]:
        """The sequence numbers that count, the last one excluded."""
        first = round(WARM_UP_S * self.rate_hz)
        return (0, EVER) if self.is_saturated else (first, first + round(self.measured_s * self.rate_hz))

    @property
    def counted_ns(self) -> tuple[int, int]:
        """The times of reception that count, the last one excluded."""
        full_s = 0.0, WARM_UP_S + self.measured_s + LATE_S
        start_s, end_s = (WARM_UP_S, WARM_UP_S + self.measured_s) if self.is_saturated else full_s
        return round(1e9 * start_s), round(1e9 * end_s)

    @property
    def keys(self) -> KeyArray:
        """A key for each seed, (seeds,)."""
        return np.array([derive_key("arena", seed) for seed in range(1, self.seeds + 1)], np.uint64)

    @property
    def mode(self) -> str:
        """What ns-3 calls the rate."""
        if self.standard == "802.11n":
            return f"HtMcs{MCS_MBPS.index(self.rate_mbps)}"
        return MODES[self.standard].format(f"{self.rate_mbps:g}".replace(".", "_")) if self.standard in MODES else "-"

    def xy_m(self) -> FloatArray:
        """Where each node is, (seeds, nodes, 2); around the origin."""
        if self.layout == "line":
            ends = [(distance_m * (-1.0) ** index, 0.0) for index, distance_m in enumerate(self.size_m)]
            return np.tile(np.array([*ends, (0.0, 0.0)]), (self.seeds, 1, 1))
        if self.layout == "pairs":
            return np.tile(np.array([(x_m, 0.0) for x_m in self.size_m]), (self.seeds, 1, 1))
        draws = uniform(self.keys[:, None, None], np.arange(self.nodes)[:, None], np.arange(2), 0, POSITION_PURPOSE)
        return self.size_m[0] * (draws - 0.5)

    def sent_at_ns(self) -> IntArray:
        """When each sender hands over its packets, (ticks, seeds, senders); as a scenario's robots do by default."""
        times = SendTimes("uniform", self.keys, np.ones(self.nodes, np.int64), self.rate_hz)
        by_tick = [times.in_tick(tick_start_ns(tick, self.rate_hz), tick) for tick in range(self.ticks)]
        return np.array(by_tick).reshape(self.ticks, self.seeds, self.nodes)[:, :, : self.senders]

    def receiver_of(self, sender: int) -> int:
        """The receiver of a sender's packets; -1: all."""
        if not self.unicast or (self.is_mixed and sender % 2):
            return -1
        if self.layout == "line":
            return self.nodes - 1
        return (sender + (self.senders if self.layout == "pairs" else 1)) % self.nodes

    def ns3_input(self, seed: int, walk_m: FloatArray | Path | None = None) -> str:
        """What `network.cc` reads for one of the seeds, counted from 0.

        `walk_m` are other places, (ticks, nodes, 2), or a movement file of ns-2.
        """
        at_ns = self.sent_at_ns()[:, seed]
        xy_m = self.xy_m()[seed][None] if walk_m is None else walk_m
        positions = [f'"{xy_m}"'] if isinstance(xy_m, Path) else xy_m.ravel().tolist()
        ticks = 0 if isinstance(xy_m, Path) else len(xy_m)
        head = [self.standard, self.mode, RATE_CONTROLS[self.rate_control], self.ampdu_bytes, self.rts_bytes]
        head += [seed + 1, self.nodes, self.payload_bytes, *self.counted, *self.counted_ns]
        head += [self.counted_ns[1] * 1e-9, ticks, self.interval_s, at_ns.size, *positions]
        packets = [
            f"{sender} {tick} {self.receiver_of(sender)} {at_ns[tick, sender]}"
            for tick in range(self.ticks)
            for sender in range(self.senders)
        ]
        return " ".join([*map(str, head), *packets])

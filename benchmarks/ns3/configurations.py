"""What both simulators run: sections of configurations, the radio of each, its places and its send times."""

from dataclasses import asdict, dataclass
from itertools import product
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
}


def radio_like_ns3(standard: str, rate_mbps: float) -> Radio:
    """A preset at this rate, with what ns-3 has by default."""
    loss = "radio.log_distance.reference_loss_db=46.6777"
    if standard == "802.15.4":
        return radio_of("ieee802154", [loss, *ALIKE[standard]])
    rate = f"radio.bit_rate_bps={round(1e6 * rate_mbps)}"
    preset = "wifi-b-1M" if standard == "802.11b" else "wifi-a-6M"
    return radio_of(preset, [loss, rate, f"radio.frame={standard}", *ALIKE["802.11"]])


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

    def as_mapping(self) -> dict[str, Any]:
        """What a record and a cache know it by."""
        return {**asdict(self), "size_m": list(self.size_m)}

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
        return where[self.layout] + (", mixed" if self.is_mixed else ", unicast" if self.unicast else "")

    @property
    def cells(self) -> list[str]:
        """The first cells of its row."""
        interval_ms = f"{1e3 * self.interval_s:g}"
        return [
            f"{self.standard} {self.rate_mbps:g}M",
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
        return round((WARM_UP_S + self.measured_s + LATE_S) * self.rate_hz)

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
        return (sender + (self.senders if self.layout == "pairs" else 1)) % self.nodes

    def ns3_input(self, seed: int, walk_m: FloatArray | Path | None = None) -> str:
        """What `network.cc` reads for one of the seeds, counted from 0.

        `walk_m` are other places, (ticks, nodes, 2), or a movement file of ns-2.
        """
        at_ns = self.sent_at_ns()[:, seed]
        xy_m = self.xy_m()[seed][None] if walk_m is None else walk_m
        positions = [f'"{xy_m}"'] if isinstance(xy_m, Path) else xy_m.ravel().tolist()
        ticks = 0 if isinstance(xy_m, Path) else len(xy_m)
        head = [self.standard, self.mode, seed + 1, self.nodes, self.payload_bytes, *self.counted, *self.counted_ns]
        head += [self.counted_ns[1] * 1e-9, ticks, self.interval_s, at_ns.size, *positions]
        packets = [
            f"{sender} {tick} {self.receiver_of(sender)} {at_ns[tick, sender]}"
            for tick in range(self.ticks)
            for sender in range(self.senders)
        ]
        return " ".join([*map(str, head), *packets])


# Sections: (standard and rate, nodes, bytes, interval in ms) and where.


Kind = tuple[str, float]
WPAN, A6, A54, B1, B11 = ("802.15.4", 0.25), ("802.11a", 6.0), ("802.11a", 54.0), ("802.11b", 1.0), ("802.11b", 11.0)
FEW = {"seeds": 10, "measured_s": 4.0}  # few nodes: more packets for the same error


def _configuration(kind: Kind, nodes: int, octets: int, interval_ms: float, **more: Any) -> Configuration:
    options: dict[str, Any] = {"seeds": 12 if kind == WPAN else 6, **more}  # few packets in 2 s, and quickly run
    return Configuration(*kind, nodes, octets, 1e-3 * interval_ms, **options)


def _line(kind: Kind, octets: int, interval_ms: float, *size_m: float, **more: Any) -> Configuration:
    return _configuration(kind, len(size_m) + 1, octets, interval_ms, layout="line", size_m=size_m, **{**FEW, **more})


def _area(kind: Kind, octets: int, interval_ms: float, side_m: float, **more: Any) -> Configuration:
    return _configuration(kind, 40, octets, interval_ms, layout="area", size_m=(side_m,), **more)


def spot() -> list[Configuration]:
    """Everybody hears everybody equally well: access to the channel alone."""
    nodes = (5, 10, 20, 40, 80)
    wpan = [*((n, 20, 100) for n in nodes), (20, 20, 50), (20, 49, 100), (40, 49, 100)]
    fast, slow = [*((n, 128, 20) for n in nodes), (80, 128, 100)], [*((n, 128, 100) for n in nodes), (20, 128, 50)]
    rows = [*((WPAN, row) for row in wpan), *((A6, row) for row in fast), (A54, fast[3]), *((B1, row) for row in slow)]
    return [_configuration(kind, *row) for kind, row in rows]


def overload() -> list[Configuration]:
    """More packets than there is time for: what waits too long is dropped."""
    rows = [(A6, 3, 128, 0.5), (A6, 2, 128, 0.4), (B1, 10, 128, 5), (B1, 5, 128, 2)]
    return [_configuration(*row, seeds=3, measured_s=1.0) for row in rows]


def distance() -> list[Configuration]:
    """One sender and one receiver: noise alone."""
    near_m = {WPAN: (95, 105, 110, 115, 120), A6: (49, 53), A54: (28, 31, 33, 35), B1: (49, 53), B11: (45, 53)}
    return [
        _line(kind, 20 if kind == WPAN else 128, 10, m) for kind, distances_m in near_m.items() for m in distances_m
    ]


def hidden() -> list[Configuration]:
    """Two senders that do not hear one another, and a receiver between them."""
    rows = [(WPAN, 20, 20, 70, 70), (WPAN, 20, 20, 55, 75), (WPAN, 89, 20, 70, 70), (WPAN, 89, 20, 55, 75)]
    rows += [(kind, 128, interval_ms, *m) for kind, interval_ms in ((A6, 10), (A6, 2), (B1, 10)) for m in BETWEEN_M]
    return [_line(*row, seeds=20) for row in rows]


def area() -> list[Configuration]:
    """40 nodes at random over a square: they hear one another well, weakly and not at all."""
    kinds = ((WPAN, 40, 100), (A6, 128, 20), (B1, 128, 100))
    return [_area(*kind, side_m) for kind, side_m in product(kinds, (40, 80, 150, 250, 400))]


def saturation() -> list[Configuration]:
    """Queues that are never empty: throughput."""
    rows = [(A6, 5, 2.5), (A6, 10, 5), (A6, 20, 5), (B1, 5, 20), (B1, 10, 40), (B1, 20, 40)]
    more: dict[str, Any] = {"is_saturated": True, "seeds": 4}
    return [
        _configuration(kind, nodes, 512, ms, unicast=to, **more)
        for to, (kind, nodes, ms) in product((False, True), rows)
    ]


def unicast() -> list[Configuration]:
    """To the next node, acknowledged and sent again."""
    rows = [(WPAN, 10, 20, 100), (WPAN, 20, 20, 100), (WPAN, 40, 20, 100), (A6, 20, 128, 20), (A6, 40, 128, 20)]
    weak = [(WPAN, 20, 20, 105), (WPAN, 20, 20, 115), (A54, 128, 10, 33)]
    rows.append((B1, 20, 128, 100))
    areas = [(WPAN, 20, 200, 80), (A6, 128, 50, 40), (A6, 128, 50, 80), (B1, 128, 200, 40), (B1, 128, 200, 60)]
    mixed = [((A6, 128, 50, 80), 12), ((B1, 128, 200, 60), 32)]
    return [
        *(_configuration(*row, unicast=True) for row in rows),
        *(_line(*row, unicast=True) for row in weak),
        *(_area(*row, unicast=True, seeds=12) for row in areas),
        *(_area(*row, unicast=True, is_mixed=True, seeds=seeds) for row, seeds in mixed),
    ]


def exposed() -> list[Configuration]:
    """Two pairs of which one sender hears the other, but not its receiver: only the NAV protects acknowledgements."""
    more: dict[str, Any] = {"layout": "pairs", "size_m": (0.0, -20.0, 40.0, -60.0), "unicast": True, **FEW}
    full = _configuration(A6, 4, 128, 0.5, **{**more, "is_saturated": True, "seeds": 4})
    return [
        _configuration(B1, 4, 128, 5, **more),
        _configuration(B11, 4, 128, 2, **more),
        _configuration(A6, 4, 128, 2, **more),
        full,
    ]


def rates() -> list[Configuration]:
    """The families of presets at their other rates, over a square."""
    kinds = [(("802.11b", 2.0), 80), (("802.11b", 5.5), 80), (B11, 80), (("802.11a", 12.0), 80)]
    kinds += [(("802.11a", 24.0), 60), (A54, 40), (("802.11g", 6.0), 80), (("802.11g", 54.0), 40)]
    return [*(_area(kind, 128, 50, side_m) for kind, side_m in kinds), _area(WPAN, 100, 200, 150)]


BETWEEN_M = ((40, 40), (30, 45))
BUILDERS = (spot, overload, distance, hidden, area, saturation, unicast, exposed, rates)
SECTIONS = {build.__name__: build for build in BUILDERS}

"""The sections of the comparison with ns-3: rows of (standard and rate, nodes, bytes, interval in ms) and where."""

from itertools import product
from typing import Any

from benchmarks.ns3 import sections_80211n
from benchmarks.ns3.configurations import Configuration

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
SECTIONS = {build.__name__: build for build in (*BUILDERS, *sections_80211n.BUILDERS)}

"""The sections of 802.11n: 5 GHz, 20 MHz, one stream, best effort."""

from collections.abc import Iterator
from itertools import product
from typing import Any

from benchmarks.ns3.configurations import MCS_MBPS, Configuration

FULL: dict[str, Any] = {"unicast": True, "is_saturated": True}
BRIEF, LONG = {"seeds": 3, "measured_s": 0.5}, {"seeds": 4, "measured_s": 3.0}  # the less vary, the more
SINGLE, SHORT = {"ampdu_bytes": 0}, {"ampdu_bytes": 4096}  # long A-MPDUs of hidden nodes vary by far too much
OCTETS = 1472  # of full queues: the largest datagram of UDP in a frame
RTS = {"rts_bytes": 500}


def _sending(mcs: int, nodes: int, octets: int, interval_ms: float, **more: Any) -> Configuration:
    return Configuration("802.11n", MCS_MBPS[mcs], nodes, octets, 1e-3 * interval_ms, **more)


def _full_pair(mcs: int, octets: int, interval_ms: float, distance_m: float, **more: Any) -> Configuration:
    options: dict[str, Any] = {"layout": "line", "size_m": (distance_m,), **FULL, **BRIEF, **more}
    return _sending(mcs, 2, octets, interval_ms, **options)


def _area(mcs: int, interval_ms: float, side_m: float, **more: Any) -> Configuration:
    return _sending(mcs, 20, 128, interval_ms, layout="area", size_m=(side_m,), seeds=4, measured_s=1.0, **more)


def aggregation() -> list[Configuration]:
    """802.11n, one pair whose queue is never empty: A-MPDUs and single frames."""
    rows = [(0, OCTETS, 1.6), (3, OCTETS, 0.4), (7, OCTETS, 0.16)]
    pairs = [_full_pair(*row, 1, **mode) for row, mode in product(rows, ({}, SINGLE))]
    return [*pairs, _full_pair(7, 500, 0.0625, 1), _full_pair(7, 500, 0.2, 1, **SINGLE)]


def stations() -> list[Configuration]:
    """802.11n, stations that always send: A-MPDUs and single frames."""
    aggregated = [(2, 0.25), (5, 0.8), (10, 2), (20, 4)]
    single = [(2, 0.5), (5, 1.25), (10, 2.5), (20, 5)]
    return [
        *(_sending(7, nodes, OCTETS, ms, **FULL, **LONG) for nodes, ms in aggregated),
        *(_sending(0, nodes, OCTETS, ms, **FULL, seeds=12, measured_s=3.0) for nodes, ms in ((5, 5), (20, 20))),
        *(_sending(7, nodes, OCTETS, ms, **FULL, **BRIEF, **SINGLE) for nodes, ms in single),
    ]


def schemes() -> list[Configuration]:
    """802.11n, one sender and one receiver: each MCS over distance."""
    near_m = {4: 46, 5: 34, 6: 31, 7: 27}
    full = [_full_pair(mcs, OCTETS, 0.16, m, **mode) for (mcs, m), mode in product(near_m.items(), ({}, SINGLE))]
    lone: dict[str, Any] = {"layout": "line", "unicast": True, "seeds": 10, "measured_s": 4.0}
    lossy = [(0, 50), (0, 53), (4, 51), (5, 37), (6, 35), (7, 31)]
    return [*full, *(_sending(mcs, 2, 128, 10, size_m=(m,), **lone) for mcs, m in lossy)]


def adaptation() -> list[Configuration]:
    """802.11n, one pair: throughput over distance with the rate of the `IdealWifiManager`."""
    return [_full_pair(7, OCTETS, 0.16, m, rate_control="ideal") for m in (5, 25, 28, 30, 34, 40, 46, 49, 51)]


def reservation() -> list[Configuration]:
    """802.11n, two senders that do not hear one another: with and without RTS/CTS."""

    def rows() -> Iterator[Configuration]:
        for protection, aggregated, seeds, full_seeds in (({}, SHORT, 24, 12), (RTS, {}, 10, 4)):
            hidden: dict[str, Any] = {"layout": "line", "size_m": (40.0, 40.0), "unicast": True, **protection}
            for interval_ms in (4, 2):
                yield _sending(3, 3, OCTETS, interval_ms, **hidden, seeds=seeds)
            for mode in (aggregated, SINGLE):
                full = {**LONG, **hidden, **mode, "seeds": full_seeds}
                yield _sending(3, 3, OCTETS, 0.8, is_saturated=True, **full)

    return list(rows())


def groups() -> list[Configuration]:
    """802.11n, broadcasts at 6 Mbit/s: in one spot and over a square; acknowledged packets there."""
    spot = [_sending(7, nodes, 128, 20, seeds=4, measured_s=1.0) for nodes in (5, 10, 20)]
    to_one = [_area(mcs, 20, side_m, unicast=True) for mcs, side_m in ((3, 30), (0, 35))]
    return [*spot, *(_area(7, 20, side_m) for side_m in (30, 60, 120)), *to_one]


BUILDERS = (aggregation, stations, schemes, adaptation, reservation, groups)

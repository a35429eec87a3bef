"""Frames on air, from a run's table of packets: its rows by receiver become one frame with what they tell."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from swarmwire.comms.packets import FATE_NAMES
from swarmwire.metrics.capture.frame import Frame

if TYPE_CHECKING:
    import polars as pl


def frames_on_air(packets: "pl.DataFrame", names: Sequence[str]) -> Iterator[Frame]:
    """The frames of one arena in the order of time; `packets` as `RunFolder.packets` has them, `names` of robots.

    A frame that nobody was within reach of has no row, and is not among them; nor is what never went on air.
    """
    import polars as pl

    once = ("on_air_at_ns", "to", "size_bytes", "topic", "payload")
    each = packets.filter(pl.col("receiver").is_not_null()).sort("receiver")
    frames = each.group_by("sender", "sequence").agg(
        *(pl.col(name).first() for name in once),
        pl.col("rssi_dbm").max().alias("strongest_dbm"),
        "receiver",
        "fate",
        "rssi_dbm",
    )
    for row in frames.sort("on_air_at_ns", "sender", "sequence").iter_rows(named=True):
        yield _frame(row, names)


def _frame(row: dict[str, Any], names: Sequence[str]) -> Frame:
    to, sender = row["to"], names[row["sender"]]
    told = f"{sender} to {'all' if to is None else names[to]}: {row['topic']}, packet {row['sequence']}"
    return Frame(
        on_air_at_ns=row["on_air_at_ns"],
        sender=row["sender"],
        to=to,
        sequence=row["sequence"],
        size_bytes=row["size_bytes"],
        payload=row["payload"] or b"",
        rssi_dbm=row["strongest_dbm"],
        comments=(told, *_fates(row, names)),
    )


def _fates(row: dict[str, Any], names: Sequence[str]) -> list[str]:
    """A comment per fate: `received: flock-1 -61.5 dBm, flock-2 -70.1 dBm`."""
    of_fate: dict[str, list[str]] = {}
    for receiver, fate, rssi_dbm in zip(row["receiver"], row["fate"], row["rssi_dbm"], strict=True):
        strength = "" if rssi_dbm is None else f" {rssi_dbm:.1f} dBm"
        of_fate.setdefault(fate, []).append(f"{names[receiver]}{strength}")
    return [f"{fate}: {', '.join(of_fate[fate])}" for fate in FATE_NAMES if fate in of_fate]

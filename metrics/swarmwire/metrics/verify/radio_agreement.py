"""Whether the totals of the radio in a run folder are those of its summary."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swarmwire.comms.packets import FATE_NAMES, Fate
from swarmwire.metrics.record.part_files import scan_files
from swarmwire.metrics.verify.agreement import BROKEN_OFF, Verdict, per_arena
from swarmwire.metrics.verify.finding import State

if TYPE_CHECKING:
    import polars as pl

# Fates that every receiver has on a link of its own.
LINK_FATES = tuple(
    FATE_NAMES[fate]
    for fate in (
        Fate.RECEIVED,
        Fate.BLOCKED,
        Fate.LOST,
        Fate.TOO_WEAK,
        Fate.COLLIDED,
        Fate.BURST,
        Fate.PARTITIONED,
        Fate.JAMMED,
    )
)
NOT_FINAL = FATE_NAMES[Fate.IN_FLIGHT]  # the summary counts packets too that never left their sender's radio


def robots_agree(files: list[Path], summary: Mapping[str, Any] | None) -> Verdict:
    """As many receivers of each fate over all senders, and of fates that links have over all receivers too."""
    table = scan_files(files)
    for row in _sums(table, [f"{side}_{fate}" for side in ("as_sender", "as_receiver") for fate in LINK_FATES]):
        for fate in LINK_FATES:
            sent, got = row[f"as_sender_{fate}"], row[f"as_receiver_{fate}"]
            if sent != got:
                text = f"{got} {fate} over receivers and {sent} over senders (arena {row['arena']})"
                return State.DIFFERS, f"{text}; expected as many"
    columns = {fate: f"as_sender_{fate}" for fate in FATE_NAMES if fate != NOT_FINAL}
    totals = {
        (row["arena"], fate): row[name]
        for row in _sums(table, list(columns.values()))
        for fate, name in columns.items()
    }
    return _compared(totals, tuple(columns), summary)


def links_agree(files: list[Path], summary: Mapping[str, Any] | None) -> Verdict:
    """As many packets of each fate that only links have, over all links."""
    import polars as pl

    found = scan_files(files).group_by("arena", "fate").agg(pl.col("packets").sum()).collect()
    return _compared({(arena, fate): packets for arena, fate, packets in found.iter_rows()}, LINK_FATES, summary)


def distances_agree(files: list[Path], summary: Mapping[str, Any] | None) -> Verdict:
    """If every packet was counted: as many that were received, over all distances."""
    told: dict[str, Any] = {} if summary is None else summary["record"].get("radio_distances", {})
    if told.get("every") != 1 or told.get("unknown") != 0:
        return None
    received = FATE_NAMES[Fate.RECEIVED]
    totals = {(row["arena"], received): row["received"] for row in _sums(scan_files(files), ["received"])}
    return _compared(totals, (received,), summary)


def _sums(table: "pl.LazyFrame", columns: list[str]) -> list[dict[str, Any]]:
    import polars as pl

    return table.group_by("arena").agg(pl.col(columns).sum()).sort("arena").collect().to_dicts()


def _compared(
    found: Mapping[tuple[int, str], int], fates: tuple[str, ...], summary: Mapping[str, Any] | None
) -> Verdict:
    """A run that did not end by itself may have broken off a tick, which its summary alone counts."""
    if summary is None or summary["ended"] in BROKEN_OFF:
        return None
    radios: list[dict[str, Any] | None] = per_arena(summary, "radio")
    for arena, radio in enumerate(radios):
        counted: dict[str, int] = radio["fates"] if radio else {}
        for fate in fates:
            expected, rows = counted.get(fate, 0), found.get((arena, fate), 0)
            if rows != expected:
                return State.DIFFERS, f"{rows} {fate} (arena {arena}); the summary has {expected}"
    return None

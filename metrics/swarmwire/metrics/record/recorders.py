"""The observers that fill a run folder."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from swarmwire.comms.clock import Clock
from swarmwire.comms.protocols import Observer
from swarmwire.metrics.metrics import Metrics
from swarmwire.metrics.record.event_recorder import EventRecorder
from swarmwire.metrics.record.packet_recorder import PacketRecorder
from swarmwire.metrics.record.static_recorder import StaticRecorder
from swarmwire.metrics.record.tick_recorder import TickRecorder

TABLES = ("ticks", "packets", "events")


def recorders(
    folder: Path,
    metrics: Metrics,
    clock: Clock,
    *,
    packets: float = 0.0,
    topics: Mapping[int, str] | None = None,
    may_drop: bool = False,
) -> list[Observer]:
    """Observers for `static.json`, `ticks`, `events` and, of a share above 0 (1: all), `packets`.

    They are apart so that one that fails leaves the others going. `metrics` must see each tick before them; `may_drop`
    is for real time, where a slow disk costs rows rather than ticks.
    """
    found: list[Observer] = [
        StaticRecorder(folder),
        TickRecorder(folder, metrics, clock, may_drop),
        EventRecorder(folder, may_drop),
    ]
    return [*found, PacketRecorder(folder, clock, packets, topics, may_drop)] if packets else found


def record_summary(parts: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The summary's `record`, of the observers' summary parts: of each table the rows written and dropped.

    A table is left out if it was not recorded, or if its recorder failed.
    """
    return {name: parts[f"record_{name}"] for name in TABLES if f"record_{name}" in parts}

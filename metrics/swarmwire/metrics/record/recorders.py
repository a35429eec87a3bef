"""The observers that fill a run folder."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from swarmwire.comms.clock import Clock
from swarmwire.comms.interfaces import Observer
from swarmwire.metrics.measure import Metrics
from swarmwire.metrics.record.distance_totals import DistanceTotals
from swarmwire.metrics.record.event_recorder import EventRecorder
from swarmwire.metrics.record.link_totals import LinkTotals
from swarmwire.metrics.record.packet_recorder import PacketRecorder
from swarmwire.metrics.record.robot_totals import RobotTotals
from swarmwire.metrics.record.static_recorder import StaticRecorder
from swarmwire.metrics.record.tick_recorder import TickRecorder

# The last is the recording for the viewer.
TABLES = ("ticks", "packets", "events", "radio_robots", "radio_distances", "radio_links", "rrd")


def recorders(
    folder: Path,
    metrics: Metrics,
    clock: Clock,
    *,
    packets: float = 0.0,
    topics: Mapping[int, str] | None = None,
    links: bool = False,
    may_drop: bool = False,
) -> list[Observer]:
    """Observers for `static.json`, `ticks`, `events`, and where there is a radio `radio_robots` and `radio_distances`.

    If asked for also `packets`, of a share above 0 (1: all), and `radio_links`.
    They are apart so that one that fails leaves the others going. `metrics` must see each tick before them; `may_drop`
    is for real time, where a slow disk costs rows rather than ticks.
    """
    found: list[Observer] = [
        StaticRecorder(folder),
        TickRecorder(folder, metrics, clock, may_drop),
        EventRecorder(folder, may_drop),
        RobotTotals(folder),
        DistanceTotals(folder),
    ]
    if packets:
        found.append(PacketRecorder(folder, clock, packets, topics, may_drop))
    return [*found, LinkTotals(folder)] if links else found


def record_summary(parts: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The summary's `record`, of the observers' summary parts: of each table the rows written and dropped.

    A table is left out if it was not recorded, or if its recorder failed.
    """
    return {name: parts[f"record_{name}"] for name in TABLES if f"record_{name}" in parts}

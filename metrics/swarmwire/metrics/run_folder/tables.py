"""The recorded tables by name, and the observers that fill a run folder. A new table is a file and a line here."""

from collections.abc import Mapping
from typing import Any

from swarmwire.comms.interfaces import Observer
from swarmwire.metrics.run_folder.distances import RadioDistances
from swarmwire.metrics.run_folder.events import Events
from swarmwire.metrics.run_folder.links import RadioLinks
from swarmwire.metrics.run_folder.packets import Packets
from swarmwire.metrics.run_folder.robots import RadioRobots
from swarmwire.metrics.run_folder.static import StaticRecorder
from swarmwire.metrics.run_folder.table import RecordOptions, Table
from swarmwire.metrics.run_folder.ticks import Ticks

TABLES: dict[str, Table] = {
    table.name: table for table in (Ticks(), Packets(), Events(), RadioRobots(), RadioDistances(), RadioLinks())
}


def recorders(options: RecordOptions) -> list[Observer]:
    """An observer for `static.json`, and one for each table that the options ask for.

    They are apart so that one that fails leaves the others going.
    """
    made = (table.recorder(options) for table in TABLES.values())
    return [StaticRecorder(options.folder), *(recorder for recorder in made if recorder is not None)]


def record_summary(parts: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The summary's `record`, of the observers' summary parts: of each table the rows written and dropped.

    A table is left out if it was not recorded, or if its recorder failed. The last is the recording for the viewer.
    """
    return {name: parts[f"record_{name}"] for name in (*TABLES, "rrd") if f"record_{name}" in parts}

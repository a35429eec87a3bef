"""`static.json`: arena, bodies, groups and names of a run, written as it begins."""

from pathlib import Path

from swarmwire.comms.interfaces import Observer
from swarmwire.comms.truth import Static
from swarmwire.metrics.record.names import STATIC
from swarmwire.metrics.record.static_file import write_static


class StaticRecorder(Observer):
    """Observer that writes `static.json`, before the first tick. No summary part."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def begin(self, static: Static) -> None:
        """Write it."""
        write_static(static, self._folder / STATIC)

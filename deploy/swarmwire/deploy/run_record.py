"""What a run leaves behind: its folder, from the scenario and the first line of the log to the summary."""

import sys
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from swarmwire.comms.clock import WallClock
from swarmwire.comms.protocols import Observer
from swarmwire.deploy.folder import make_folder
from swarmwire.deploy.origin import Origin, origin_of
from swarmwire.deploy.recording import Recording
from swarmwire.deploy.result import Result
from swarmwire.deploy.trajectory_log import TrajectoryLog
from swarmwire.metrics.metrics import Metrics
from swarmwire.metrics.record.run_log import RunLog
from swarmwire.world.scenario import Scenario

SUMMARY = "summary.json"


class RunRecord:
    """The folder of one run, or, with `out` None, nothing but what people are told.

    Attributes:
        folder: the run folder, if any.
    """

    def __init__(self, out: Path | None, clock: WallClock) -> None:
        """Make the folder; BadInput unless it is new or empty, or can be made."""
        self.folder = None if out is None else make_folder(out)
        self._clock = clock
        self._log = RunLog(self.folder, clock) if self.folder else None

    def observers(
        self, what: Recording, run_id: str, metrics: Metrics, hashes: Callable[[], list[str]], *, may_drop: bool
    ) -> Sequence[Observer]:
        """Those that fill the folder."""
        if self.folder is None:
            return ()
        recorders = what.observers(self.folder, run_id, metrics, self._clock, may_drop)
        return (*recorders, TrajectoryLog(self.folder, hashes))

    def begin(
        self,
        scenario: Scenario,
        agents: Mapping[str, str],
        *,
        seeds: tuple[int, ...],
        ticks: int,
        runners: int,
        realtime: float | None,
    ) -> Origin:
        """Put into the folder all that the run is made from; what that is."""
        origin = origin_of(
            scenario, agents, seeds=seeds, ticks=ticks, runners=runners, realtime=realtime, folder=self.folder
        )
        self.note(
            f"swarmwire {version('swarmwire-deploy')}: {scenario.name}, seeds {list(seeds)}, {ticks} ticks, {runners} runners"
        )
        return origin

    def say(self, text: str) -> None:
        """Tell people at once, and keep it in the log."""
        print(text, file=sys.stderr, flush=True)
        self.note(text)

    def note(self, text: str) -> None:
        """Keep it in the log."""
        if self._log:
            self._log.say(text)

    def close(self, result: Result) -> None:
        """Write the summary, the last of all: where it is, the run is over."""
        self.note(f"ended: {result.ended}, {result.ticks} ticks" + (f": {result.error}" if result.error else ""))
        if self._log:
            self._log.close()
        if self.folder:
            result.write(self.folder / SUMMARY)


def dropped_rows(record: Mapping[str, Mapping[str, Any]]) -> dict[str, int]:
    """Rows that a slow disk cost, by name, as they are counted in the summary."""
    return {f"rows_dropped_{table}": of["dropped"] for table, of in record.items() if of["dropped"]}

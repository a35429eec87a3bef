"""What a run leaves behind: its folder, from the scenario and the first line of the log to the summary."""

import sys
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from shutil import rmtree
from types import TracebackType

from swarmwire.comms.clock import WallClock
from swarmwire.comms.errors import BadInput, RecordFailed
from swarmwire.comms.interfaces import AgentBackend, Observer, TimedBackend
from swarmwire.comms.messages import DICT_TAG, message_classes
from swarmwire.deploy.control.control_server import ControlServer
from swarmwire.deploy.live.published import Published
from swarmwire.deploy.record.inputs import InputsRecord, RecordedBackend
from swarmwire.deploy.record.live_events import LiveEventsLog, LiveEventsRecord
from swarmwire.deploy.record.new_folder import make_folder
from swarmwire.deploy.record.origin import Origin, origin_of
from swarmwire.deploy.record.recording import Recording
from swarmwire.deploy.record.trajectory_log import TrajectoryLog
from swarmwire.deploy.refusals import refusal
from swarmwire.deploy.result import Result
from swarmwire.metrics.measure import Metrics
from swarmwire.metrics.run_folder.layout import RECORDING, SUMMARY
from swarmwire.metrics.run_folder.log import RunLog
from swarmwire.metrics.run_folder.table import RecordOptions
from swarmwire.metrics.run_folder.tables import recorders
from swarmwire.metrics.viewer.recording import RerunRecording
from swarmwire.world.backends.join_policy import ListenSettings
from swarmwire.world.live_events import LiveEvent
from swarmwire.world.scenario.scenario import Scenario


class RunRecord:
    """The folder of one run, or, with `out` None, nothing but what people are told.

    Attributes:
        folder: the run folder, if any.
        failed: why there is no summary in it, once the run is over; None if there is, or no folder.
    """

    def __init__(self, out: Path | None, clock: WallClock) -> None:
        """Make the folder; BadInput unless it is new or empty, or can be made."""
        self.folder = None if out is None else make_folder(out)
        self._clock = clock
        self._log = RunLog(self.folder, clock) if self.folder else None
        self._recorded: RecordedBackend | None = None
        self._live_events = LiveEventsLog(self.folder) if self.folder else None
        self.failed: RecordFailed | None = None

    def observers(
        self,
        what: Recording,
        run_id: str,
        metrics: Metrics,
        hashes: Callable[[], list[str]],
        control: ControlServer,
        *,
        may_drop: bool,
        door: ListenSettings | None = None,
    ) -> Sequence[Observer]:
        """Those that fill the folder, and let others look on and control it; `metrics` must see each tick before.

        `door` is where others meet it beyond this machine.
        """
        folder, clock = self.folder, self._clock
        if folder is None:
            return ()
        found: list[Observer] = [TrajectoryLog(folder, hashes)]
        if what.tables:
            topics = {DICT_TAG: "dict"} | {kind.tag: kind.__name__ for kind in message_classes()}
            found += recorders(
                RecordOptions(folder, metrics, clock, what.packets, topics, links=what.links, may_drop=may_drop)
            )
        if what.rrd:
            found.append(RerunRecording(folder / RECORDING, metrics, clock, selected=what.select))
        published = Published(folder, run_id, metrics, clock, selected=what.select, declare=control.declare, door=door)
        return (*found, published)

    def begin(
        self,
        scenario: Scenario,
        code: Sequence[str],
        seeds: tuple[int, ...],
        *,
        ticks: int,
        runners: int,
        realtime: float | None,
        subtick_s: float | None,
        gateways: Mapping[str, str],
        metrics: Metrics,
    ) -> Origin:
        """Put into the folder all that the run is made from; what that is. RecordFailed if the disk refuses."""
        try:
            origin = origin_of(
                scenario,
                code,
                seeds=seeds,
                ticks=ticks,
                runners=runners,
                realtime=realtime,
                subtick_s=subtick_s,
                metrics=metrics.metrics,
                gateways=gateways,
                folder=self.folder,
            )
        except OSError as error:
            raise self._refused(self.folder, error) from error
        what = f"{scenario.name}, seeds {list(seeds)}, {ticks} ticks, {runners} runners"
        self.note(f"swarmwire {version('swarmwire-deploy')}: {what}")
        return origin

    def failed_to_start(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None
    ) -> None:
        """Say in the log why there was no first tick; there is nothing to sum up. What is refused leaves no folder."""
        if error is None:
            return
        self.note(f"failed to start: {error}")
        if self._log:
            self._log.close()
        if isinstance(error, BadInput) and self.folder:
            rmtree(self.folder, ignore_errors=True)  # it was new or empty, so all that is in it is of this run
            self.folder = self._log = None

    def recorded(
        self, backend: AgentBackend | TimedBackend, outside: Callable[[int], bool]
    ) -> AgentBackend | TimedBackend:
        """The backend, with its actions kept in the folder from the first tick on at which `outside(tick)` holds."""
        if self.folder is None:
            return backend
        self._recorded = RecordedBackend(backend, self.folder, outside)
        return self._recorded

    def inputs(self) -> InputsRecord | None:
        """What was recorded of the backend; None if nothing."""
        return self._recorded.record() if self._recorded else None

    def keep(self, live_event: LiveEvent) -> None:
        """Record what somebody does to the run, before it takes effect; OSError if it cannot be recorded."""
        if self._live_events is None:
            return
        try:
            self._live_events.keep(live_event)
        except OSError as error:
            what = "end" if live_event.table is None else "happen"
            self.say(f"event {live_event.number} does not {what}, as it cannot be recorded: {error}")
            raise

    def live_events(self) -> LiveEventsRecord | None:
        """What was recorded of what people did to the run; None if nothing."""
        return self._live_events.record() if self._live_events else None

    def say(self, text: str) -> None:
        """Keep it in the log, and tell people at once; a terminal that is gone must not end a run."""
        self.note(text)
        try:
            print(text, file=sys.stderr, flush=True)
        except (OSError, ValueError) as error:
            self.note(f"(nobody could be told: {error})")

    def note(self, text: str) -> None:
        """Keep it in the log."""
        if self._log:
            self._log.say(text)

    def close(self, result: Result) -> None:
        """Write the summary, the last of all: where it is, the run is over. What the disk refuses is in `failed`."""
        self.note(f"ended: {result.ended}, {result.ticks} ticks" + (f": {result.error}" if result.error else ""))
        if self._log:
            self._log.close()
        if self.folder:
            try:
                result.write(self.folder / SUMMARY)
            except OSError as error:  # the result is there all the same: whoever waited for it is to have it
                self.failed = self._refused(self.folder / SUMMARY, error)

    def _refused(self, what: Path | None, error: OSError) -> RecordFailed:
        return RecordFailed(f"{what} cannot be written: {refusal(error) or error}")

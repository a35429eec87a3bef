"""Recordings for rerun's viewer: an arena and its metrics over time, in a file or sent to a viewer."""

import os
from pathlib import Path
from typing import Any

from swarmwire.comms.base.clock import Clock
from swarmwire.comms.base.extras import VIEW
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.metrics.measures.measure import MetricValues
from swarmwire.metrics.pictures.viewer.program import Target
from swarmwire.metrics.pictures.viewer.rows import RerunRows
from swarmwire.metrics.pictures.viewer.selection import ARENA, selected_robot
from swarmwire.metrics.records.run_folder.layout import RECORDING_END
from swarmwire.metrics.records.run_folder.writer import ChunkLimit

RESERVED_BYTES = 1_000_000  # disk space for the rows before the first tick
SEND_BYTES = 1_000_000
QUIET = "re_log_encoding::rrd::file_sink=error"  # rerun warns of each file without a footer


class RerunRecording(Observer):
    """Observer that writes the first arena of a run to a file for `rerun`, with timelines `tick` and `sim_time`.

    Every tick is written in full; in swarms of more than 200 robots, links, lost packets, trails, and rays without a
    hit are written every tenth tick. `metrics` must observe each tick before the recording, which plots its values.
    Equal runs give equal contents, without wall-clock time, but not equal bytes: rerun numbers its chunks at random.
    """

    _send_bytes = SEND_BYTES

    def __init__(self, path: Path | None, metrics: MetricValues, clock: Clock, selected: str | None = None) -> None:
        """Record to this file, which is replaced; BadInput without the extra [view].

        Rows are written after at most 2 s of `clock`.

        `selected` names the robot that is shown in detail: its rays, its ring, its radio's range. None: the first robot
        of the first group with rays or photocells. While it is dead, the next living robot of its group is shown. A
        subclass with another target has no path.
        """
        self._name = f"recording {path.name}" if path else "live view"
        VIEW.need(self._name)
        self._path, self._metrics, self._clock = path, metrics, clock
        self._selected = selected

    def begin(self, static: Static) -> None:
        """Open the file and log the constants; BadInput for an unknown selected robot."""
        os.environ.setdefault("RUST_LOG", f"warn,{QUIET}")
        import rerun as rr

        from swarmwire.metrics.pictures.viewer.layout import about
        from swarmwire.metrics.pictures.viewer.plots import RerunPlots
        from swarmwire.metrics.pictures.viewer.scene import RerunArena

        self._static, seed = static, static.seeds[ARENA]
        selected = selected_robot(static, self._selected, self._name)
        self._arena_view = RerunArena(static, selected)
        self._plots = RerunPlots(static, self._metrics.metrics)
        self._rec: Any = rr.RecordingStream("swarmwire", recording_id=f"{static.name} s{seed}", send_properties=False)
        self._rows, self._limit = RerunRows(self._rec), ChunkLimit(self._send_bytes, self._clock)
        self._ticks = 0
        self._rec.set_log_time_enabled(False)
        self._rec.set_log_tick_enabled(False)
        self._connect(self._layout(static, selected))
        self._rec.send_recording_name(f"{static.name}, seed {seed}")
        links_every = self._arena_view.links_every_ticks
        run = rr.AnyValues(scenario=static.name, seed=seed, robots=static.robots, links_every_ticks=links_every)
        self._rec.send_property("run", run)
        text = about(static, selected, links_every)
        self._rec.log("about", rr.TextDocument(text, media_type="text/markdown"), static=True)
        self._arena_view.begin(self._rec)
        self._plots.begin(self._rec)

    def see(self, truth: Truth) -> None:
        """Record a tick, until the arena has left."""
        import rerun as rr

        if not truth.running[ARENA]:
            return

        rows = self._rows
        rows.begin_tick(truth.tick, truth.time_ns)
        self._arena_view.add(rows, truth)
        texts = [] if self._ticks else [f"the run begins: {self._static.robots} robots"]
        for event in truth.events:
            robots = ", ".join(event.changed_names(self._static)[ARENA])
            if event.singly and not robots:
                continue
            texts.append(f"{event.words}: {robots or 'no robot'}")
        for text in texts:
            rows.add("events", rr.TextLog.columns, text=[text])
        self._plots.add(rows, self._metrics.latest, truth)
        self._ticks += 1
        if self._limit.reached(rows.buffered_bytes):
            rows.send()
            self._limit.restart()

    def _layout(self, static: Static, selected: str) -> Any:
        """Return the blueprint of the recording."""
        from swarmwire.metrics.pictures.viewer.layout import layout

        return layout(static, selected)

    def _connect(self, layout: Any) -> None:
        """Connect the stream to its target; OSError on a full disk, where rerun would wait forever."""
        assert self._path is not None  # subclasses without a path override this
        try:
            self._path.write_bytes(bytes(RESERVED_BYTES))
        except OSError:
            self._path.unlink(missing_ok=True)
            raise
        # The manifest in a footer would keep 37 kB of each block in memory until the file is closed, and the viewer
        # reads a file from its begin.
        self._rec.save(self._path, default_blueprint=layout, write_footer=False)

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Close the file, also after a failure. Summary part: `record_rrd`, with rows (ticks) and dropped rows."""
        import rerun as rr

        try:
            self._rows.send()
        finally:
            try:
                self._rec.send_property(RECORDING_END, rr.AnyValues(ticks=self._ticks))
                self._rec.flush()
            finally:
                self._rec.disconnect()
        return {"record_rrd": {"rows": self._ticks, "dropped": 0}}


class RerunLive(RerunRecording):
    """Observer that draws a run in a viewer, which shows the newest tick.

    It needs a process of its own: calls block while rerun's program does not read.
    """

    _send_bytes = 0  # every tick is sent at once

    def __init__(
        self,
        target: Target,
        metrics: MetricValues,
        clock: Clock,
        selected: str | None = None,
        *,
        page: bool = False,
    ) -> None:
        """Draw in the program at "rerun+http://…/proxy", or pass the recording to a function in parts, tick by tick.

        The first part contains all constants and the layout; each part can be read separately. `page` selects the
        layout for the web page. BadInput without the extra [view].
        """
        super().__init__(None, metrics, clock, selected)
        self._target, self._page = target, page
        self._stream: Any = None

    def begin(self, static: Static) -> None:
        """Draw the constants; BadInput for an unknown selected robot."""
        super().begin(static)
        self._send_part()

    def see(self, truth: Truth) -> None:
        """Draw a tick."""
        super().see(truth)
        self._send_part()

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """End the recording."""
        summary = super().end(last)
        self._send_part()
        return summary

    def _layout(self, static: Static, selected: str) -> Any:
        from swarmwire.metrics.pictures.viewer.layout import layout, page_layout

        return page_layout(static, selected) if self._page else layout(static, selected, "following")

    def _connect(self, layout: Any) -> None:
        self._arena_view.links_every_ticks = 1  # the publisher already omits links in most ticks
        if isinstance(self._target, str):
            self._rec.connect_grpc(self._target, default_blueprint=layout)
        else:
            self._stream = self._rec.binary_stream()
            self._rec.send_blueprint(layout)

    def _send_part(self) -> None:
        if not isinstance(self._target, str) and (part := self._stream.read()):
            self._target(part)

"""One execution of a scenario, tick by tick or to its end."""

from collections.abc import Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self, Unpack

from swarmwire.comms.base.clock import to_s
from swarmwire.comms.base.errors import Interrupted, RecordFailed
from swarmwire.comms.observe.interfaces import Observer, StopConditions
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.deploy.machine import keep_memory
from swarmwire.deploy.runs.config import RunConfig, RunOptions, check_options
from swarmwire.deploy.runs.gateways.serving import Served
from swarmwire.deploy.runs.observers import failed_records, failures, observers_of
from swarmwire.deploy.runs.record.folder import RunWriter
from swarmwire.deploy.runs.result import Result, result_of
from swarmwire.deploy.runs.wiring import OUTSIDE, RunParts
from swarmwire.world.backends.runner_reports import RunnerHealth
from swarmwire.world.loop import Loop
from swarmwire.world.scenario.scenario import Scenario


def run(scenario: RunConfig | Scenario | Path | str, **options: Unpack[RunOptions]) -> Result:
    """Run a scenario to its end and return its result; `options` are the fields of `RunConfig`.

    For example `run("scenario.toml", seeds=9, runners=4, overrides=["radio.loss=0.3"], out="runs/lossy")`. Ctrl-C ends
    the run after the tick under way.

    Raises BadInput for anything wrong with the scenario or the options, TypeError for an unknown option, AgentFailed
    with the agent's traceback, RunnerLost if a runner's process or link is gone, and RecordFailed, with the result, if
    the run folder `out` has no summary, as on a full disk. Tables and observers that failed before are counts of the
    result, `observer_failed_…`.
    """
    return finished(Simulation(scenario, **options))


class Simulation:
    """A scenario, checked and ready; entered, it has its agents and can be stepped; left, it has a result.

    So::

        with Simulation("scenario.toml", seed=3) as simulation:
            while simulation.tick < 100:
                truth = simulation.step()
        print(simulation.result.metrics["order"].final)

    The arguments are those of `swarmwire.deploy.run`, and so are the errors.

    Attributes:
        config: what the run was asked to be.
        scenario: as checked.
        world: every arena's bodies and sensors; do not move it by hand.
        metrics: what was measured up to the last tick, in `metrics.latest`.
        ticks: of the whole run.
        runners: processes that run the agents; 0: none, they are in this one.
        agents: the spec of each group's agent.
        code: the specs of all classes of users: agents, custom sensors, actuators and metrics.
        run_id: the name of this execution.
        interrupt: entered, SIGINT, SIGTERM or SIGHUP ends `run` after the tick under way.
        stop_conditions: end arenas, as the scenario's do; others may take their place before the run.
        controls: pause, step, speed and end of `run`, for other threads.
        live_events: events begun and ended from any thread during the run.
        served: entered, the robots that answer as real ones, if any.
    """

    def __init__(self, scenario: RunConfig | Scenario | Path | str, **options: Unpack[RunOptions]) -> None:
        """Check all and make the run folder; `options` are the fields of `RunConfig`. BadInput names what is wrong."""
        check_options("run and Simulation", options, RunConfig)
        if isinstance(scenario, RunConfig) and options:
            raise TypeError(f"run and Simulation: expected {next(iter(options))} as a field of the RunConfig")
        self.config = scenario if isinstance(scenario, RunConfig) else RunConfig(scenario, **options)
        parts = self._parts = RunParts(self.config)
        self.scenario, self.world, self.metrics, self.ticks = parts.scenario, parts.world, parts.metrics, parts.ticks
        self.runners, self.agents, self.code, self.run_id = parts.runners, parts.agents, parts.code, parts.run_id
        self.interrupt, self.controls, self.live_events = parts.interrupt, parts.controls, parts.live_events
        self.stop_conditions: StopConditions | None = parts.stop
        self.served: Served | None = None
        self._watching: list[Observer] = []
        self._result: Result | None = None

    @property
    def folder(self) -> Path | None:
        """The run folder, if any."""
        return self._parts.folder.path

    @property
    def static(self) -> Static:
        """What does not change during the run."""
        return self.world.static

    @property
    def tick(self) -> int:
        """Ticks done so far; also the number of the next one."""
        return self._parts.loop.ticks_done if self._parts.loop else 0

    @property
    def result(self) -> Result:
        """The result, once the run is over; RuntimeError before."""
        if self._result is None:
            raise RuntimeError("the run is not over yet: leave the `with` block first")
        return self._result

    def hashes(self) -> list[str]:
        """The trajectory hash of each arena, up to the last tick."""
        return self._parts.hashes()

    def health(self) -> RunnerHealth | None:
        """The state of the runners; None if there are none."""
        return self._parts.health()

    def compiled_ns(self) -> int:
        """Wall time in which this process has compiled kernels for the run so far."""
        return self._parts.compiling.total_ns()

    def watch(self, observer: Observer) -> None:
        """Add an observer, before the run begins; one that raises is reported, counted and left out from then on."""
        self._watching.append(observer)

    def __enter__(self) -> Self:
        """Start the agents; AgentFailed or RunnerLost if that fails."""
        parts = self._parts
        if parts.loop is not None:
            raise RuntimeError("a simulation runs once; make another one")
        keep_memory()
        with ExitStack() as stack:
            stack.push(parts.folder.failed_to_start)
            stack.enter_context(parts.compiling)
            parts.begin()
            stack.enter_context(parts.interfaces())
            self.served = stack.enter_context(parts.served())
            stack.enter_context(parts.gateways_on_robots(self.served))
            listening = self.config.listening
            if parts.published and listening and listening.observed:  # an endpoint is refused before agents join
                stack.callback(parts.published.close)
                parts.published.open()
            backend = stack.enter_context(parts.new_backend(self.served))
            self._observers = observers_of(parts, self._watching, self.served)
            parts.connect(backend, self._observers, self.stop_conditions)
            early = [of for of in self._observers if of.before_agents] if listening else []
            with ExitStack() as unless_begun:
                for observer in early:  # people see who is missing
                    observer.begin(self.static)
                    unless_begun.callback(observer.end, None)
                backend.start()
                unless_begun.pop_all()
            health = self.health()
            parts.foreign_agents = bool(health and (health.robots_free or health.foreign))
            for observer in self._observers:
                if observer not in early:
                    observer.begin(self.static)
            self._exit = stack.pop_all()
        self._started_ns = self._parts.clock.now_ns()
        return self

    def step(self) -> Truth:
        """One tick; returns the observers' view of it. Ticks may exceed the scenario's duration."""
        return self._entered().step()

    def apply_event(self, event: Mapping[str, Any]) -> int:
        """Have an event happen at the start of the next tick: a table as in a scenario, without at_s. Its number.

        BadInput says what is wrong with it. `live_events.end` undoes one that lasts.
        """
        return self.live_events.submit(event)

    def run(self, ticks: int | None = None) -> None:
        """Run up to tick `ticks`, or to the scenario's end, until all arenas have stopped, or until an interrupt."""
        loop = self._entered()
        with (
            self._parts.priority(),
            suppress(Interrupted),
        ):  # while it waited for runners: the summary says how far it came
            until = self.ticks if ticks is None else ticks
            loop.run(until, self._parts.stopped, self._parts.wait)

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """End the agents, and close the records with a summary: also of a run that failed, when it is worth most.

        RecordFailed if the summary cannot be written, unless the run failed; `result` is there all the same.
        """
        loop = self._entered()
        parts, ended = self._parts, self._ended(error)
        ended_ns = parts.clock.now_ns()
        with self._exit:
            last = loop.end()
            entries: dict[str, Any] = {}
            for observer in self._observers:
                entries.update(observer.end(last))
            self._result = result_of(
                parts,
                entries,
                failures(self._observers),
                ended=ended,
                error=str(error) if ended == "failed" else None,
                wall_s=to_s(ended_ns - self._started_ns - self.controls.paused_ns),
                start_s=to_s(self._started_ns - parts.called_ns),
            )
        self._close(parts.folder, failed=error is not None)

    def _close(self, folder: RunWriter, *, failed: bool) -> None:
        """Write the summary; the error of a run that failed is worth more than that of its folder, which is printed."""
        result = self.result
        try:
            folder.close(result.summary(), failed_records(self._observers))
        except RecordFailed as lost:
            if not failed:
                raise RecordFailed(str(lost), result) from lost
            folder.say(str(lost))

    def _entered(self) -> Loop:
        if self._result is not None:
            raise RuntimeError(OUTSIDE)
        return self._parts.entered_loop()

    def _ended(self, error: BaseException | None) -> str:
        if isinstance(error, KeyboardInterrupt | Interrupted):
            return "interrupted"
        if error is not None:
            return "failed"
        if not self.world.running.any():
            return "stopped"
        if self.tick >= self.ticks:
            return "duration"
        return "interrupted" if self._parts.stopped() else "left"


def finished(simulation: Simulation) -> Result:
    """The result of a simulation that is run to its end here; Ctrl-C ends it after the tick under way."""
    with simulation.interrupt, simulation:
        simulation.run()
    return simulation.result

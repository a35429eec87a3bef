"""One execution of a scenario, tick by tick or to its end.

A run has three phases, each with its type: a `Plan` is checked, a `PreparedRun` has its folder and controls, and a
`Run` has its agents and observers.
"""

from collections.abc import Mapping
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, Self, Unpack

from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.base.errors import Interrupted, RecordFailed
from swarmwire.comms.observe.interfaces import Observer, StopConditions
from swarmwire.comms.observe.truth import Truth
from swarmwire.deploy.machine import keep_memory
from swarmwire.deploy.runs.backends import runner_health
from swarmwire.deploy.runs.config import RunConfig, RunOptions, check_options
from swarmwire.deploy.runs.control_server import Status
from swarmwire.deploy.runs.gateways.serving import Served
from swarmwire.deploy.runs.phases import Run, prepare
from swarmwire.deploy.runs.result import Outcome, Result, result_of
from swarmwire.world.backends.runner_reports import RunnerHealth
from swarmwire.world.scenario.scenario import Scenario

OUTSIDE = "a simulation is stepped within its `with` block"


def run(scenario: RunConfig | Scenario | Path | str, **options: Unpack[RunOptions]) -> Result:
    """Run a scenario to its end and return its result; `options` are the fields of `RunConfig`.

    For example `run("scenario.toml", seeds=9, runners=4, overrides=["radio.loss=0.3"], out="runs/lossy")`. Ctrl-C ends
    the run after the present tick.

    Raises BadInput for anything wrong with the scenario or the options, TypeError for an unknown option, AgentFailed
    with the agent's traceback, RunnerLost if a runner's process or link is gone, and RecordFailed, with the result, if
    the run folder `out` has no summary, as on a full disk. Tables and observers that failed before are counts of the
    result, `observer_failed_…`.
    """
    return run_to_end(Simulation(scenario, **options))


class Simulation:
    """A scenario, checked and ready; its agents live within its `with` block, and after it there is a result.

    For example::

        with Simulation("scenario.toml", seed=3) as simulation:
            while simulation.tick < 100:
                truth = simulation.step()
        print(simulation.result.metrics["order"].final)

    The arguments are those of `swarmwire.deploy.run`, and so are the errors.

    Attributes:
        plan: the checked options and scenario.
        world: the bodies and sensors of every arena; do not move it by hand.
        metrics: the values measured in the last tick are in `metrics.latest`.
        run_id: the name of this execution.
        interrupt: a context in which SIGINT, SIGTERM or SIGHUP ends `run` after the present tick.
        stop_conditions: end arenas, as the scenario's do; may be replaced before the run.
        controls: pause, step, speed and end of `run`, for other threads.
        live_events: events begun and ended from any thread during the run.
    """

    def __init__(self, scenario: RunConfig | Scenario | Path | str, **options: Unpack[RunOptions]) -> None:
        """Check the run and make its folder; `options` are the fields of `RunConfig`. BadInput names the fault."""
        check_options("run and Simulation", options, RunConfig)
        if isinstance(scenario, RunConfig) and options:
            raise TypeError(f"run and Simulation: expected {next(iter(options))} as a field of the RunConfig")
        clock = WallClock()
        self._called_ns = self._start_ns = clock.now_ns()  # the start moves to the first tick
        config = scenario if isinstance(scenario, RunConfig) else RunConfig(scenario, **options)
        prepared = self._prepared = prepare(config, clock)
        self.plan, self.world, self.run_id = prepared.plan, prepared.world, prepared.run_id
        self.metrics, self.live_events = prepared.metrics, prepared.live_events
        self.controls, self.interrupt = prepared.controls, prepared.interrupt
        self.stop_conditions: StopConditions | None = prepared.measured_stop
        self._observers: list[Observer] = list(self.plan.config.observers)
        self._resources = ExitStack()  # everything that ends with the run
        self._run: Run | None = None
        self._result: Result | None = None

    @property
    def folder(self) -> Path | None:
        """Path of the run folder, if there is one."""
        return self._prepared.writer.path

    @property
    def tick(self) -> int:
        """Number of ticks done; also the number of the next tick."""
        return self._run.loop.ticks_done if self._run else 0

    @property
    def served(self) -> Served | None:
        """Robots of an open run that answer as real ones; None without gateways."""
        return self._run.served if self._run else None

    @property
    def result(self) -> Result:
        """The result after the run; RuntimeError before."""
        if self._result is None:
            raise RuntimeError("the run is not over yet: leave the `with` block first")
        return self._result

    def hashes(self) -> list[str]:
        """Return the trajectory hash of each arena, up to the last tick."""
        return self._run.loop.hexdigests() if self._run else []

    def health(self) -> RunnerHealth | None:
        """Return the state of the runners; None without runners."""
        return runner_health(self._run.backend) if self._run else None

    def compiled_ns(self) -> int:
        """Return the wall time that this process has spent on compiling kernels for the run."""
        return self._prepared.compiling.total_ns()

    def watch(self, observer: Observer) -> None:
        """Add an observer before the run; one that raises is reported, counted and left out."""
        self._observers.append(observer)

    def __enter__(self) -> Self:
        """Start the agents, and wait for first poses; AgentFailed, RunnerLost or BadInput if that fails."""
        if self._run is not None:
            raise RuntimeError("a simulation runs once; make another one")
        keep_memory()
        prepared = self._prepared
        with ExitStack() as stack:
            stack.push(prepared.writer.failed_to_start)
            stack.enter_context(prepared.compiling)
            # Set before observers begin, since they read `served` and `health`.
            run = self._run = prepared.open(stack, self._observers, self.stop_conditions)
            with run.observers.begin(self.plan.static, agents_join=self.plan.config.listening is not None):
                run.loop.backend.start()
            self._resources = stack.pop_all()
        self._start_ns = prepared.clock.now_ns()
        return self

    def step(self) -> Truth:
        """Run one tick and return the observers' view of it. Ticks may exceed the scenario's duration."""
        return self._open_run().loop.step()

    def apply_event(self, event: Mapping[str, Any]) -> int:
        """Apply an event at the start of the next tick and return its number; a table as in a scenario, without at_s.

        BadInput names the fault. `live_events.end` ends an event that lasts.
        """
        return self.live_events.submit(event)

    def run(self, ticks: int | None = None) -> None:
        """Run up to tick `ticks`, or to the scenario's end, until all arenas have stopped, or until an interrupt."""
        run, until = self._open_run(), self.plan.ticks if ticks is None else ticks
        # Interrupted is raised while the run waits for runners; the summary has the ticks so far.
        with self._prepared.priority(), suppress(Interrupted):
            run.loop.run(until, self._prepared.is_stopped, partial(self._wait, run.status))

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """End the agents, and close the records with a summary, also of a run that failed.

        RecordFailed if the summary cannot be written, unless the run failed; `result` is there all the same.
        """
        run, end_ns = self._open_run(), self._prepared.clock.now_ns()
        ended = self._ended(error)
        with self._resources:
            last = run.loop.end()
            entries = run.observers.end(last)
            outcome = Outcome(
                ended=ended,
                error=str(error) if ended == "failed" else None,
                wall_ns=end_ns - self._start_ns - self.controls.paused_ns,
                start_ns=self._start_ns - self._called_ns,
            )
            result = self._result = result_of(run, self.plan, self.world, self._prepared.writer, entries, outcome)
        try:
            self._prepared.writer.close(result.summary(), run.observers.failed_records())
        except RecordFailed as lost:
            if error is None:
                raise RecordFailed(str(lost), result) from lost
            self._prepared.writer.report(str(lost))  # the error of the run itself is raised

    def _wait(self, status: Status, tick: int) -> None:
        self.controls.wait(tick, self._prepared.is_stopped)
        status.began()

    def _open_run(self) -> Run:
        if self._run is None or self._result is not None:
            raise RuntimeError(OUTSIDE)
        return self._run

    def _ended(self, error: BaseException | None) -> str:
        if isinstance(error, KeyboardInterrupt | Interrupted):
            return "interrupted"
        if error is not None:
            return "failed"
        if not self.world.running.any():
            return "stopped"
        if self.tick >= self.plan.ticks:
            return "duration"
        return "interrupted" if self._prepared.is_stopped() else "left"


def run_to_end(simulation: Simulation) -> Result:
    """Run a simulation to its end and return its result; Ctrl-C ends it after the present tick."""
    with simulation.interrupt, simulation:
        simulation.run()
    return simulation.result

"""One execution of a scenario, tick by tick or to its end.

A run has three phases, each with its type: a `Plan` is checked, a `Simulation` has its folder and controls, and a `Run`
has its agents and observers.
"""

from collections.abc import Mapping
from contextlib import AbstractContextManager, ExitStack, nullcontext, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, Self, Unpack, cast

from swarmwire.comms.base.clock import PreciseClock, WallClock, to_ns
from swarmwire.comms.base.errors import Interrupted, RecordFailed
from swarmwire.comms.base.ethernet import FRAME_TAG
from swarmwire.comms.observe.interfaces import AgentBackend, Observer, StopConditions, TimedBackend
from swarmwire.comms.observe.truth import Truth
from swarmwire.comms.robot.messages import DICT_TAG, message_classes
from swarmwire.deploy.machine import keep_memory, need_address_space, need_open_files, need_threads
from swarmwire.deploy.runs.backends import (
    BackendSettings,
    RunnerLog,
    open_backend,
    runner_health,
)
from swarmwire.deploy.runs.compiling import CompileTime
from swarmwire.deploy.runs.config import RunConfig, RunOptions, check_options
from swarmwire.deploy.runs.control_server import ControlServer, Status
from swarmwire.deploy.runs.controls import Controls, Interrupt
from swarmwire.deploy.runs.gateways.serving import RunGateways, Served, Undriven
from swarmwire.deploy.runs.interfaces import InterfacesLog, OpenInterfaces
from swarmwire.deploy.runs.live_address import new_run_id
from swarmwire.deploy.runs.observers import (
    EmptyBatteries,
    MemoryReturn,
    ObserverStage,
    RunObservers,
    StagedObserver,
    TooLarge,
)
from swarmwire.deploy.runs.plan import make_plan
from swarmwire.deploy.runs.published import ObserverEndpoint, Published
from swarmwire.deploy.runs.real_time import raised_priority, warm_up
from swarmwire.deploy.runs.record.folder import RunWriter
from swarmwire.deploy.runs.record.inputs import ReplayedBackend
from swarmwire.deploy.runs.record.provenance import RunFacts
from swarmwire.deploy.runs.record.replay_logs import TrajectoryLog
from swarmwire.deploy.runs.result import Outcome, Result, result_of
from swarmwire.deploy.runs.runners import check_isolation
from swarmwire.metrics.measures.measure import MeasuredStopConditions, Metrics
from swarmwire.metrics.measures.network.latency import RadioTally
from swarmwire.metrics.pictures.viewer.recording import RerunRecording
from swarmwire.metrics.records.run_folder.events import EventLog
from swarmwire.metrics.records.run_folder.layout import RECORDING
from swarmwire.metrics.records.run_folder.table import RecordOptions
from swarmwire.metrics.records.run_folder.tables import recorders
from swarmwire.world.backends.pacing import Pace
from swarmwire.world.backends.runner_reports import RunnerHealth
from swarmwire.world.interfaces.backend import InterfacesBackend
from swarmwire.world.live_events import LiveEvents
from swarmwire.world.loop import Loop
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.subtick import Subticks

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


@dataclass(frozen=True)
class Run:
    """An open run: its loop, with the agents of all robots and the observers of each tick."""

    loop: Loop
    backend: AgentBackend
    observers: RunObservers
    status: Status
    served: Served | None  # robots that answer as real ones
    facts: RunFacts
    log: RunnerLog


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
        self._clock = WallClock()
        self._called_ns = self._start_ns = self._clock.now_ns()  # the start moves to the first tick
        self.plan, self.world = make_plan(
            scenario if isinstance(scenario, RunConfig) else RunConfig(scenario, **options)
        )
        self._check_machine()
        plan, static = self.plan, self.plan.static
        self._writer = RunWriter(plan.out, self._clock)
        clock = PreciseClock(self._clock) if plan.subtick_s else self._clock
        self._pace = None if plan.factor is None else Pace(clock, static.rate_hz, plan.factor, self._writer.report)
        self.metrics = Metrics(plan.metrics)
        self._measured_stop = (
            MeasuredStopConditions(self.metrics, plan.stop_conditions) if plan.stop_conditions else None
        )
        self.stop_conditions: StopConditions | None = self._measured_stop
        self.run_id, self.interrupt = new_run_id(), Interrupt()
        self.controls = Controls(self._clock, static.rate_hz, self._pace, speed_fixed=plan.gateways is not None)
        bodies = {group.name: group.body for group in static.groups}
        replayed = plan.config.replay.live_events if plan.config.replay else None
        self.live_events = LiveEvents(plan.scenario, bodies, self._writer.keep, replayed)
        self._compiling = CompileTime(self._clock)
        self._observers: list[Observer] = list(plan.config.observers)
        self._resources = ExitStack()  # everything that ends with the run
        self._run: Run | None = None
        self._result: Result | None = None

    @property
    def folder(self) -> Path | None:
        """Path of the run folder, if there is one."""
        return self._writer.path

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
        return self._compiling.total_ns()

    def watch(self, observer: Observer) -> None:
        """Add an observer before the run; one that raises is reported, counted and left out."""
        self._observers.append(observer)

    def __enter__(self) -> Self:
        """Start the agents; AgentFailed or RunnerLost if that fails."""
        if self._run is not None:
            raise RuntimeError("a simulation runs once; make another one")
        keep_memory()
        with ExitStack() as stack:
            stack.push(self._writer.failed_to_start)
            stack.enter_context(self._compiling)
            run = self._run = self._open(stack)  # observers that begin read it
            with run.observers.begin(self.plan.static, agents_join=self.plan.config.listening is not None):
                run.backend.start()
            self._resources = stack.pop_all()
        self._start_ns = self._clock.now_ns()
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
        with self._priority(), suppress(Interrupted):
            run.loop.run(until, self._is_stopped, partial(self._wait, run.status))

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """End the agents, and close the records with a summary, also of a run that failed.

        RecordFailed if the summary cannot be written, unless the run failed; `result` is there all the same.
        """
        run, end_ns = self._open_run(), self._clock.now_ns()
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
            result = self._result = result_of(run, self.plan, self.world, self._writer, entries, outcome)
        try:
            self._writer.close(result.summary(), run.observers.failed_records())
        except RecordFailed as lost:
            if error is None:
                raise RecordFailed(str(lost), result) from lost
            self._writer.report(str(lost))  # the error of the run itself is raised

    def _check_machine(self) -> None:
        """Raise BadInput if this machine is too small for the run, or cannot isolate its agents."""
        plan = self.plan
        if plan.isolation.strict:
            check_isolation(plan.isolation)
        need_open_files(plan.runners if plan.config.listening is None else plan.robots)
        if plan.runners or plan.out is not None:  # a run without them has neither a network nor tables
            need_address_space()
            need_threads(plan.runners)

    def _open(self, stack: ExitStack) -> Run:
        """Make all parts of the run, which end with the stack."""
        plan, writer, static = self.plan, self._writer, self.plan.static
        if plan.interfaces:
            plan.interfaces.check_machine(static, plan.factor)  # only here: a scenario can be checked on any machine
        facts = writer.begin(plan.scenario, plan.facts())
        if self._pace:  # kernels are loaded before gateways answer, and before the pace begins
            world = plan.new_world()
            warm_up(world, plan.new_medium(world), plan.metrics, subticks=plan.subtick_s is not None)
        interfaces = served = None
        if plan.interfaces and self._pace:
            interfaces = stack.enter_context(plan.interfaces.open(static, self._pace, writer.path))
        if plan.gateways:
            served = stack.enter_context(self._serve(plan.gateways, has_interfaces=interfaces is not None))
        if served and interfaces:
            stack.enter_context(interfaces.with_gateways(served.robot_addresses()))
        endpoint = self._observer_endpoint(stack)
        log = RunnerLog(writer.report)
        backend = stack.enter_context(open_backend(self._backend_settings(log), served))
        loop = self._new_loop(backend, interfaces, log)
        status = self._new_status(backend, loop)
        staged = self._staged_observers(status, endpoint)
        if served:
            staged.append(StagedObserver(ObserverStage.PROGRAMS, Undriven(served, self._factor, writer.report)))
        if interfaces:
            staged.append(StagedObserver(ObserverStage.PROGRAMS, InterfacesLog(interfaces, writer.report)))
        observers = RunObservers(staged, writer.report)
        loop.observers = observers.ordered
        return Run(loop, backend, observers, status, served, facts, log)

    def _serve(self, gateways: RunGateways, *, has_interfaces: bool) -> AbstractContextManager[Served]:
        writer, agents = self._writer, self.plan.agents
        return gateways.serve(
            self.world, agents, self._clock, self._factor, writer.path, writer.report, separate=has_interfaces
        )

    def _observer_endpoint(self, stack: ExitStack) -> ObserverEndpoint:
        """Return the endpoint of observers.

        An endpoint beyond this machine opens at once, so that one in use is refused before agents join, by BadInput.
        """
        listening = self.plan.config.listening
        endpoint = ObserverEndpoint(listening.for_observers(self.run_id) if listening else None)
        if listening and listening.observed and self._writer.path:
            stack.callback(endpoint.close)
            endpoint.open()
        return endpoint

    def _backend_settings(self, log: RunnerLog) -> BackendSettings:
        plan, pace, subticks = self.plan, self._pace, None
        if pace and plan.subtick_s:
            subticks = Subticks(self._clock, pace, plan.static.rate_hz, plan.subtick_s)
        return BackendSettings(plan, self.run_id, self._clock, pace, subticks, log, self._is_stopped)

    def _new_loop(self, backend: AgentBackend, interfaces: OpenInterfaces | None, log: RunnerLog) -> Loop:
        """Return the loop, without observers; actions that need not follow from the seed are recorded in the folder."""
        plan, replay = self.plan, self.plan.config.replay
        acting = backend
        if replay and replay.inputs:
            acting = ReplayedBackend(backend, replay.inputs, plan.robots, plan.static.rate_hz)
        if interfaces:
            subtick_ns = to_ns((plan.subtick_s or 0.0) * self._factor)
            acting = InterfacesBackend(cast("TimedBackend", acting), interfaces.ports, subtick_ns)
        acting = self._writer.record_actions(acting, partial(self._has_external_actions, backend, log))
        return Loop(
            self.world,
            plan.new_medium(self.world, plan.config.threads),
            acting,
            (),
            plan.scenario.events,
            self.stop_conditions,
            self.live_events,
            cast("TimedBackend", acting) if plan.recorded_subtick_s is not None else None,
            interfaces.follow if interfaces else None,
        )

    def _has_external_actions(self, backend: AgentBackend, log: RunnerLog, tick: int) -> bool:
        """Return True if the actions of this tick need not follow from scenario and seed.

        Called in each tick up to the first for which it returns True.
        """
        plan, replay = self.plan, self.plan.config.replay
        if replay and replay.inputs:
            return tick >= replay.inputs.first_tick
        if tick == 0 and (health := runner_health(backend)) and (health.robots_free or health.foreign):
            return True
        in_real_time = self._pace is not None and (plan.runners > 0 or plan.subtick_s is not None)
        has_changed = bool(log.losses) or any(event.tick >= 0 for event in log.events)
        return in_real_time or has_changed or plan.gateways is not None

    def _new_status(self, backend: AgentBackend, loop: Loop) -> Status:
        return Status(
            run_id=self.run_id,
            scenario=self.plan.scenario.name,
            ticks=self.plan.ticks,
            metrics=self.metrics,
            controls=self.controls,
            clock=self._clock,
            health=partial(runner_health, backend),
            counts=loop.counts,
            radio=lambda: self.live_events.progress.radio,
            events=self.live_events.listing,
            compiled_ns=self._compiling.total_ns,
        )

    def _staged_observers(self, status: Status, endpoint: ObserverEndpoint) -> list[StagedObserver]:
        """Return the observers of any run, those that write its folder and publish it, and those of the caller."""
        writer = self._writer
        staged = [
            (ObserverStage.MEASUREMENT, self.metrics),
            *([(ObserverStage.MEASUREMENT, self._measured_stop)] if self._measured_stop else []),
            (ObserverStage.STATUS, status),
            (ObserverStage.SUMMARY, RadioTally()),
            (ObserverStage.SUMMARY, EventLog()),
            (ObserverStage.WARNING, TooLarge(writer.report)),
            (ObserverStage.WARNING, EmptyBatteries(writer.report)),
            (ObserverStage.WARNING, MemoryReturn(self._clock)),
            *((ObserverStage.CALLER, observer) for observer in self._observers),
        ]
        if writer.path:
            staged += ((ObserverStage.RECORD, observer) for observer in self._recorders(writer.path))
            staged.append((ObserverStage.PUBLICATION, self._new_published(writer.path, status, endpoint)))
        return [StagedObserver(stage, observer) for stage, observer in staged]

    def _recorders(self, folder: Path) -> list[Observer]:
        """Return the observers that write the run folder; they may drop rows only in real time."""
        record, metrics, clock = self.plan.record, self.metrics, self._clock
        observers: list[Observer] = [TrajectoryLog(folder, self.hashes)]  # first: it has each tick of a killed run
        if record.tables:
            topics = {DICT_TAG: "dict", FRAME_TAG: "frame"} | {kind.tag: kind.__name__ for kind in message_classes()}
            may_drop = self._pace is not None
            options = RecordOptions(
                folder, metrics, clock, record.packets, topics, links=record.links, may_drop=may_drop
            )
            observers += recorders(options)
        if record.rrd:
            observers.append(RerunRecording(folder / RECORDING, metrics, clock, selected=record.select))
        return observers

    def _new_published(self, folder: Path, status: Status, endpoint: ObserverEndpoint) -> Published:
        events, note = self.live_events, self._writer.note
        published = Published(
            folder,
            self.run_id,
            self.metrics,
            self._clock,
            selected=self.plan.record.select,
            declare=ControlServer(status, self.controls, events.submit, events.end, note).declare,
            endpoint=endpoint,
        )
        self.controls.on_pause = published.catch_up
        return published

    @property
    def _factor(self) -> float:
        """Simulated s per s of wall time in real time, else 1."""
        return self._pace.factor if self._pace else 1.0

    def _priority(self) -> AbstractContextManager[None]:
        """Return a context in which the loop of a real-time run has priority over other processes."""
        if self._pace is None:
            return nullcontext()
        # With sub-ticks the priority matters so much that the message is also printed.
        return raised_priority(self._writer.report if self.plan.subtick_s else self._writer.note)

    def _is_stopped(self) -> bool:
        return self.interrupt.requested or self.controls.quit_requested

    def _wait(self, status: Status, tick: int) -> None:
        self.controls.wait(tick, self._is_stopped)
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
        return "interrupted" if self._is_stopped() else "left"


def run_to_end(simulation: Simulation) -> Result:
    """Run a simulation to its end and return its result; Ctrl-C ends it after the present tick."""
    with simulation.interrupt, simulation:
        simulation.run()
    return simulation.result

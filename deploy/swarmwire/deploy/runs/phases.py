"""The phases of a run after its plan: a `PreparedRun` has a folder and controls, a `Run` has agents and observers."""

from collections.abc import Sequence
from contextlib import AbstractContextManager, ExitStack, nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import cast

from swarmwire.comms.base.clock import PreciseClock, ScaledClock, WallClock, to_ns
from swarmwire.comms.base.ethernet import FRAME_TAG
from swarmwire.comms.base.extras import VIEW
from swarmwire.comms.observe.interfaces import AgentBackend, Observer, StopConditions, TimedBackend
from swarmwire.comms.robot.messages import CRTP_TAG, DICT_TAG, RELAY_TAG, message_classes
from swarmwire.comms.robot.tick_io import SparseTable
from swarmwire.deploy.machine import need_address_space, need_open_files, need_threads
from swarmwire.deploy.runs.backends import (
    BackendSettings,
    RunnerLog,
    open_backend,
    runner_health,
)
from swarmwire.deploy.runs.compiling import CompileTime
from swarmwire.deploy.runs.config import RunConfig
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
from swarmwire.deploy.runs.plan import Plan, make_plan
from swarmwire.deploy.runs.pose_sources import check_live_sources, open_sources
from swarmwire.deploy.runs.published import ObserverEndpoint, Published
from swarmwire.deploy.runs.real_time import raised_priority, warm_up
from swarmwire.deploy.runs.record.folder import RunWriter
from swarmwire.deploy.runs.record.inputs import ReplayedBackend
from swarmwire.deploy.runs.record.provenance import RunFacts
from swarmwire.deploy.runs.record.replay_logs import TrajectoryLog
from swarmwire.deploy.runs.ros_radio import check_relay, open_ros_radio
from swarmwire.deploy.runs.runners import check_isolation
from swarmwire.metrics.measures.measure import MeasuredStopConditions, Metrics
from swarmwire.metrics.measures.network.latency import RadioTally
from swarmwire.metrics.pictures.viewer.recording import RerunRecording
from swarmwire.metrics.records.run_folder.events import EventLog
from swarmwire.metrics.records.run_folder.layout import RECORDING
from swarmwire.metrics.records.run_folder.table import RecordOptions
from swarmwire.metrics.records.run_folder.tables import recorders
from swarmwire.world.backends.pacing import Pace
from swarmwire.world.backends.ports import PortsBackend
from swarmwire.world.gateways.crazyflie.radio import CrazyradioPorts
from swarmwire.world.gateways.ros2.radio import RosRadio
from swarmwire.world.live_events import LiveEvents
from swarmwire.world.loop import Loop
from swarmwire.world.motion.live import FollowingBackend, LiveSource, wait_for_poses
from swarmwire.world.subtick import Subticks
from swarmwire.world.world import World


@dataclass(frozen=True)
class Run:
    """An open run: its loop, with the agents of all robots and the observers of each tick."""

    loop: Loop
    backend: AgentBackend
    observers: RunObservers
    status: Status
    served: Served | None  # robots that answer as real ones
    pose_sources: tuple[LiveSource, ...]
    ros_radio: RosRadio | None  # topics of ROS 2 on the radio
    facts: RunFacts
    log: RunnerLog


@dataclass(frozen=True, kw_only=True)
class PreparedRun:
    """A run with its folder and controls, which may be opened once."""

    plan: Plan
    world: World  # the world at its start
    run_id: str
    clock: WallClock
    pace: Pace | None  # None: as fast as possible
    writer: RunWriter
    metrics: Metrics
    measured_stop: MeasuredStopConditions | None  # the scenario's stop conditions
    interrupt: Interrupt
    controls: Controls
    live_events: LiveEvents
    compiling: CompileTime

    @property
    def factor(self) -> float:
        """Simulated s per s of wall time in real time, else 1."""
        return self.pace.factor if self.pace else 1.0

    def is_stopped(self) -> bool:
        """Return True if the run must end before the next tick."""
        return self.interrupt.requested or self.controls.quit_requested

    def priority(self) -> AbstractContextManager[None]:
        """Return a context in which the loop of a real-time run has priority over other processes."""
        if self.pace is None:
            return nullcontext()
        # With sub-ticks the priority matters so much that the message is also printed.
        return raised_priority(self.writer.report if self.plan.subtick_s else self.writer.note)

    def open(self, stack: ExitStack, observers: Sequence[Observer], stop_conditions: StopConditions | None) -> Run:
        """Make all parts of the run, which end with the stack; `observers` are those of the caller."""
        plan, writer, static = self.plan, self.writer, self.plan.static
        # Only here: a scenario can be checked and probed on any machine, and not in real time.
        if plan.interfaces:
            plan.interfaces.check_machine(static, plan.factor)
        if not plan.config.replay:
            check_live_sources(plan.scenario, static, in_real_time=plan.factor is not None)
            check_relay(plan.scenario, list(plan.gateways.kinds.values()) if plan.gateways else [])
        facts = writer.begin(plan.scenario, plan.facts())
        if self.pace:  # kernels are loaded before gateways answer, and before the pace begins
            world = plan.new_world()
            warm_up(world, plan.new_medium(world), plan.metrics, subticks=plan.subtick_s is not None)
        interfaces = served = None
        if plan.interfaces and self.pace:
            interfaces = stack.enter_context(plan.interfaces.open(static, self.pace, writer.path))
        if plan.gateways:
            served = stack.enter_context(self._serve(plan.gateways, has_interfaces=interfaces is not None))
        if served and interfaces:
            stack.enter_context(interfaces.with_gateways(served.robot_addresses()))
        pose_sources: tuple[LiveSource, ...] = ()
        if plan.scenario.live_motions() and not plan.config.replay:
            poses = open_sources(plan.scenario, static, self.clock, writer.report)
            pose_sources = stack.enter_context(poses)
        ros_radio = open_ros_radio(plan.scenario, static, served, pose_sources, ScaledClock(self.clock, self.factor))
        endpoint = self._observer_endpoint(stack)
        log = RunnerLog(writer.report)
        backend = stack.enter_context(open_backend(self._backend_settings(log), served))
        loop = self._new_loop(
            backend, interfaces, ros_radio, served.crazyradio if served else None, pose_sources, log, stop_conditions
        )
        status = self._new_status(backend, loop, pose_sources)
        staged = self._staged_observers(loop, status, endpoint, observers)
        if served:
            staged.append(StagedObserver(ObserverStage.PROGRAMS, Undriven(served, self.factor, writer.report)))
        if interfaces:
            staged.append(StagedObserver(ObserverStage.PROGRAMS, InterfacesLog(interfaces, writer.report)))
        run_observers = RunObservers(staged, writer.report)
        loop.observers = run_observers.ordered
        return Run(loop, backend, run_observers, status, served, pose_sources, ros_radio, facts, log)

    def _serve(self, gateways: RunGateways, *, has_interfaces: bool) -> AbstractContextManager[Served]:
        writer, agents = self.writer, self.plan.agents
        return gateways.serve(
            self.world, agents, self.clock, self.factor, writer.path, writer.report, separate=has_interfaces
        )

    def _observer_endpoint(self, stack: ExitStack) -> ObserverEndpoint:
        """Return the endpoint of observers.

        An endpoint beyond this machine opens at once, so that one in use is refused before agents join, by BadInput.
        """
        listening = self.plan.config.listening
        endpoint = ObserverEndpoint(listening.for_observers(self.run_id) if listening else None)
        if listening and listening.observed and self.writer.path:
            stack.callback(endpoint.close)
            endpoint.open()
        return endpoint

    def _backend_settings(self, log: RunnerLog) -> BackendSettings:
        plan, pace, subticks = self.plan, self.pace, None
        if pace and plan.subtick_s:
            subticks = Subticks(self.clock, pace, plan.static.rate_hz, plan.subtick_s)
        return BackendSettings(plan, self.run_id, self.clock, pace, subticks, log, self.is_stopped)

    def _new_loop(
        self,
        backend: AgentBackend,
        interfaces: OpenInterfaces | None,
        ros_radio: RosRadio | None,
        crazyradio: CrazyradioPorts | None,
        pose_sources: Sequence[LiveSource],
        log: RunnerLog,
        stop_conditions: StopConditions | None,
    ) -> Loop:
        """Return the loop, without observers; actions that need not follow from the seed are recorded in the folder."""
        plan, replay = self.plan, self.plan.config.replay
        acting, set_first_poses = backend, self.world.set_first_poses
        subtick_ns = to_ns((plan.subtick_s or 0.0) * self.factor)
        if replay and replay.inputs:
            acting = ReplayedBackend(backend, replay.inputs, plan.robots, plan.static.rate_hz, set_first_poses)
        if pose_sources and self.pace:
            first_poses = partial(self._first_poses, pose_sources)
            acting = FollowingBackend(acting, pose_sources, self.pace, subtick_ns, first_poses)
        for ports in (ros_radio, interfaces.ports if interfaces else None):
            acting = PortsBackend(acting, ports, subtick_ns) if ports else acting
        if crazyradio:
            acting = PortsBackend(acting, crazyradio, subtick_ns, crazyradio.accept_statuses)
        acting = self.writer.record_actions(acting, partial(self._has_external_actions, backend, log))
        return Loop(
            self.world,
            plan.new_medium(self.world, plan.config.threads),
            acting,
            observers=(),
            events=plan.scenario.events,
            stop_conditions=stop_conditions,
            live_events=self.live_events,
            timed=cast("TimedBackend", acting) if plan.recorded_subtick_s is not None else None,
            external_events=interfaces.follow if interfaces else None,
        )

    def _first_poses(self, sources: Sequence[LiveSource]) -> SparseTable:
        """Wait for the first poses of live sources, place the robots there, and return the poses."""
        poses = wait_for_poses(sources, self.clock, self.writer.report, self.is_stopped)
        self.world.set_first_poses(poses)
        return poses

    def _has_external_actions(self, backend: AgentBackend, log: RunnerLog, tick: int) -> bool:
        """Return True if the actions of this tick need not follow from scenario and seed.

        Called in each tick up to the first for which it returns True.
        """
        plan, replay = self.plan, self.plan.config.replay
        if replay and replay.inputs:
            return tick >= replay.inputs.first_tick
        if tick == 0 and (health := runner_health(backend)) and (health.robots_free or health.foreign):
            return True
        in_real_time = self.pace is not None and (plan.runners > 0 or plan.subtick_s is not None)
        has_changed = bool(log.losses) or any(event.tick >= 0 for event in log.events)
        has_poses = bool(plan.scenario.live_motions())
        return in_real_time or has_changed or has_poses or plan.gateways is not None

    def _new_status(self, backend: AgentBackend, loop: Loop, pose_sources: Sequence[LiveSource]) -> Status:
        return Status(
            run_id=self.run_id,
            scenario=self.plan.scenario.name,
            ticks=self.plan.ticks,
            metrics=self.metrics,
            controls=self.controls,
            clock=self.clock,
            health=partial(runner_health, backend),
            counts=loop.counts,
            radio=lambda: self.live_events.progress.radio,
            events=self.live_events.listing,
            compiled_ns=self.compiling.total_ns,
            poses=lambda: [source.status() for source in pose_sources],
        )

    def _staged_observers(
        self, loop: Loop, status: Status, endpoint: ObserverEndpoint, observers: Sequence[Observer]
    ) -> list[StagedObserver]:
        """Return the observers of any run, those that write its folder and publish it, and those of the caller."""
        writer = self.writer
        staged = [
            (ObserverStage.MEASUREMENT, self.metrics),
            *([(ObserverStage.MEASUREMENT, self.measured_stop)] if self.measured_stop else []),
            (ObserverStage.STATUS, status),
            (ObserverStage.SUMMARY, RadioTally()),
            (ObserverStage.SUMMARY, EventLog()),
            (ObserverStage.WARNING, TooLarge(writer.report)),
            (ObserverStage.WARNING, EmptyBatteries(writer.report)),
            (ObserverStage.WARNING, MemoryReturn(self.clock)),
            *((ObserverStage.CALLER, observer) for observer in observers),
        ]
        if writer.path:
            staged += ((ObserverStage.RECORD, observer) for observer in self._recorders(writer.path, loop))
            staged.append((ObserverStage.PUBLICATION, self._new_published(writer.path, status, endpoint)))
        return [StagedObserver(stage, observer) for stage, observer in staged]

    def _recorders(self, folder: Path, loop: Loop) -> list[Observer]:
        """Return the observers that write the run folder; they may drop rows only in real time."""
        record, metrics, clock = self.plan.record, self.metrics, self.clock
        observers: list[Observer] = [TrajectoryLog(folder, loop.hexdigests)]  # first: it has each tick of a killed run
        if record.tables:
            topics = {DICT_TAG: "dict", FRAME_TAG: "frame", RELAY_TAG: "relay", CRTP_TAG: "crtp"} | {
                kind.tag: kind.__name__ for kind in message_classes()
            }
            may_drop = self.pace is not None
            options = RecordOptions(
                folder, metrics, clock, record.packets, topics, links=record.links, may_drop=may_drop
            )
            observers += recorders(options)
        if record.rrd and not VIEW.missing():
            observers.append(RerunRecording(folder / RECORDING, metrics, clock, selected=record.select))
        return observers

    def _new_published(self, folder: Path, status: Status, endpoint: ObserverEndpoint) -> Published:
        events, note = self.live_events, self.writer.note
        published = Published(
            folder,
            self.run_id,
            self.metrics,
            self.clock,
            selected=self.plan.record.select,
            declare=ControlServer(status, self.controls, events.submit, events.end, note).declare,
            endpoint=endpoint,
        )
        self.controls.on_pause = published.catch_up
        return published


def prepare(config: RunConfig, clock: WallClock) -> PreparedRun:
    """Check the run and the machine, and make the run folder; BadInput names the fault."""
    plan, world = make_plan(config)
    _check_machine(plan)
    static, writer, metrics = plan.static, RunWriter(plan.out, clock), Metrics(plan.metrics)
    pace = None
    if plan.factor is not None:
        pace = Pace(PreciseClock(clock) if plan.subtick_s else clock, static.rate_hz, plan.factor, writer.report)
    bodies = {group.name: group.body for group in static.groups}
    replayed = config.replay.live_events if config.replay else None
    return PreparedRun(
        plan=plan,
        world=world,
        run_id=new_run_id(),
        clock=clock,
        pace=pace,
        writer=writer,
        metrics=metrics,
        measured_stop=MeasuredStopConditions(metrics, plan.stop_conditions) if plan.stop_conditions else None,
        interrupt=Interrupt(),
        controls=Controls(clock, static.rate_hz, pace, speed_fixed=plan.gateways is not None),
        live_events=LiveEvents(plan.scenario, bodies, writer.keep, replayed),
        compiling=CompileTime(clock),
    )


def _check_machine(plan: Plan) -> None:
    """Raise BadInput if this machine is too small for the run, or cannot isolate its agents."""
    if plan.isolation.strict:
        check_isolation(plan.isolation)
    need_open_files(plan.runners if plan.config.listening is None else plan.robots)
    if plan.runners or plan.out is not None:  # a run without them has neither a network nor tables
        need_address_space()
        need_threads(plan.runners)

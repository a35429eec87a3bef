"""The parts of a run, made from its config and connected."""

from collections.abc import Generator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import cast

from swarmwire.agent.isolation import Isolation
from swarmwire.comms.base.clock import PreciseClock, WallClock, to_ns
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.observe.interfaces import AgentBackend, Observer, StopConditions, TimedBackend
from swarmwire.deploy.machine import need_address_space, need_open_files, need_threads
from swarmwire.deploy.runs.backends import Backends
from swarmwire.deploy.runs.compiling import CompileTime
from swarmwire.deploy.runs.config import (
    Recording,
    RunConfig,
    choose_seeds,
    real_time_factor,
    runner_count,
    scenario_of,
    subtick_of,
    tick_count,
)
from swarmwire.deploy.runs.control_server import ControlServer, Status
from swarmwire.deploy.runs.controls import Controls, Interrupt
from swarmwire.deploy.runs.gateways.gateways import as_gateways
from swarmwire.deploy.runs.gateways.serving import RunGateways, Served
from swarmwire.deploy.runs.interfaces import OpenInterfaces, RunInterfaces
from swarmwire.deploy.runs.published import Published
from swarmwire.deploy.runs.real_time import before_other_processes, warm_up
from swarmwire.deploy.runs.record.folder import RunWriter
from swarmwire.deploy.runs.record.inputs import ReplayedBackend
from swarmwire.deploy.runs.record.provenance import RunFacts, cpu, module_digests, versions
from swarmwire.deploy.runs.runners import check_isolation, new_run_id
from swarmwire.deploy.runs.scenario_parts import (
    agent_specs,
    check_agents,
    conditions,
    measuring,
    new_medium,
    scenario_traces,
)
from swarmwire.metrics.measures.measure import MeasuredStopConditions, Metrics
from swarmwire.metrics.records.run_folder.layout import metric_info
from swarmwire.world.backends.pacing import Pace
from swarmwire.world.backends.realtime_backend import PacedBackend, RealTimeBackend, RealTimeReport
from swarmwire.world.backends.runner_reports import Loss, RunnerEvent, RunnerHealth
from swarmwire.world.backends.zenoh_backend import LockstepBackend
from swarmwire.world.gateways.backend import GatewayBackend
from swarmwire.world.interfaces.backend import InterfacesBackend
from swarmwire.world.live_events import LiveEvents
from swarmwire.world.loop import Loop
from swarmwire.world.scenario.bodies import bodies_of, custom_code
from swarmwire.world.subtick import Subticks
from swarmwire.world.world import World

OUTSIDE = "a simulation is stepped within its `with` block"


class RunParts:
    """The parts of one run.

    Attributes:
        called_ns: wall time at which the run was asked for.
        code: the specs of all classes of users: agents, custom sensors, actuators and metrics.
        stop: the scenario's stop conditions, if it has any.
        record: what to record.
        folder: the run folder.
        pace: of real time, if the run keeps to the wall clock.
        open_interfaces: the robots' network interfaces, while they have some.
        facts: from what the run was made, once it has begun.
        compiling: how long this process has compiled kernels, while it is entered.
        losses: runners lost so far.
        runner_events: runners that joined, left, were lost, returned, or restarted a process so far.
    """

    def __init__(self, config: RunConfig) -> None:
        """Make and check all that can be before the agents start; BadInput names what cannot be."""
        self.config, self.clock = config, WallClock()
        self.called_ns = self.clock.now_ns()
        self.scenario = scenario_of(config.scenario, config.overrides)
        self.gateways = RunGateways(as_gateways(config.gateways), self.scenario)
        factor = self.gateways.factor(real_time_factor(config.realtime))
        self._subtick_s = subtick_of(config.subtick, factor, self.scenario)
        self.agents = agent_specs(self.scenario)
        self.world = self._new_world(choose_seeds(self.scenario, config.seed, config.seeds))
        static = self.world.static
        measures = measuring(self.scenario)
        self.metrics = Metrics(measures.metrics)
        stops = conditions(self.scenario)
        self.stop = MeasuredStopConditions(self.metrics, stops) if stops else None
        self.code = tuple(dict.fromkeys([*self.agents.values(), *custom_code(static), *measures.code]))
        self._traces = scenario_traces(self.scenario)
        replay = config.replay
        self._interfaces = RunInterfaces(self.scenario, repeated=replay is not None)
        self.open_interfaces: OpenInterfaces | None = None
        self._factor = factor
        self.ticks = replay.ticks if replay else tick_count(self.scenario)
        self._recorded_subtick_s = replay.subtick_s if replay else self._subtick_s
        self.runners = runner_count(config.runners, static.arenas * static.robots)
        self.runners = self.runners if config.listening is None else 1  # at least; the result has their number
        hidden = (str(Path(config.out).resolve()),) if config.out is not None else ()
        self.isolation = Isolation(config.agent_network, config.isolate, hidden)
        self.record = config.record or Recording()
        self._check()
        # Only now a folder: a refused run leaves none.
        self.folder = RunWriter(None if config.out is None else Path(config.out), self.clock)
        rate_hz = static.rate_hz
        clock = PreciseClock(self.clock) if self._subtick_s else self.clock
        self.pace = None if factor is None else Pace(clock, rate_hz, factor, self.folder.say)
        self.run_id, self.interrupt = new_run_id(), Interrupt()
        self.controls = Controls(self.clock, rate_hz, self.pace, speed_fixed=bool(self.gateways.kinds))
        bodies = {group.name: group.body for group in static.groups}
        self.live_events = LiveEvents(self.scenario, bodies, self.folder.keep, replay.live_events if replay else None)
        self.compiling = CompileTime(self.clock)
        self.status = self._new_status()
        self.published = self._new_published(self.folder.path) if self.folder.path else None
        self.losses: list[Loss] = []
        self.runner_events: list[RunnerEvent] = []
        self.foreign_agents = False  # whether it began with robots without an agent, or with code of another machine
        self.facts: RunFacts
        self.backend: AgentBackend | None = None
        self.loop: Loop | None = None

    def begin(self) -> None:
        """Write into the folder from what the run is made, before anything else starts."""
        self._interfaces.check_machine(self.world.static, self._factor)  # only here: a scenario can be checked anywhere
        self.facts = self.folder.begin(
            self.scenario,
            RunFacts(
                seeds=self.world.static.seeds,
                ticks=self.ticks,
                runners=self.runners,
                realtime=self.pace.factor if self.pace else None,
                files=(),
                modules=module_digests(self.code),
                cpu=cpu(),
                versions=versions(),
                gateways=self.gateways.kinds,
                metrics=tuple(metric_info(metric) for metric in self.metrics.metrics),
                subtick_s=self._recorded_subtick_s,
            ),
        )
        if self.pace:  # kernels are loaded before anything answers, and the pace begins
            world = self._new_world(self.world.static.seeds)
            medium = new_medium(self.scenario, world, self._traces)
            warm_up(world, medium, self.metrics.metrics, subticks=self._subtick_s is not None)

    def served(self) -> AbstractContextManager[Served | None]:
        """The robots that answer as real ones within the context; None if there are none."""
        return self.gateways.served(
            self.world,
            self.agents,
            self.clock,
            self.factor,
            self.folder.path,
            self.folder.say,
            separate=self.open_interfaces is not None,
        )

    @contextmanager
    def interfaces(self) -> Generator[None]:
        """The robots have their network interfaces within the context, if the scenario has some."""
        with self._interfaces.opened(self.world.static, self.pace, self.folder.path) as self.open_interfaces:
            yield

    def gateways_on_robots(self, served: Served | None) -> AbstractContextManager[None]:
        """The gateways' servers are also within the robots' namespaces in the context, if there are both."""
        if served is None or self.open_interfaces is None:
            return nullcontext()
        return self.open_interfaces.with_gateways(served.on_robots())

    def new_backend(self, served: Served | None) -> AbstractContextManager[AgentBackend]:
        """The agents, ended with the context."""
        pace, subtick_s = self.pace, self._subtick_s
        return Backends(
            scenario=self.scenario,
            static=self.world.static,
            agents=self.agents,
            runners=self.runners,
            isolation=self.isolation,
            run_id=self.run_id,
            clock=self.clock,
            pace=pace,
            stopped=self.stopped,
            listening=self.config.listening,
            lost=self.losses.append,
            changed=self.runner_events.append,
            say=self.folder.say,
            subticks=Subticks(self.clock, pace, self.world.static.rate_hz, subtick_s) if pace and subtick_s else None,
        ).backend(served)

    def connect(self, backend: AgentBackend, observers: Sequence[Observer], stop: StopConditions | None) -> None:
        """Make the loop; actions that need not follow from the seed are kept in the folder."""
        static, replay = self.world.static, self.config.replay
        acting = backend
        if replay and replay.inputs:
            acting = ReplayedBackend(backend, replay.inputs, static.arenas * static.robots, static.rate_hz)
        if self.open_interfaces:
            acting = InterfacesBackend(
                cast("TimedBackend", acting),
                self.open_interfaces.ports,
                to_ns((self._subtick_s or 0.0) * self.factor),
            )
        acting = self.folder.recorded(acting, self._from_outside)
        self.backend = backend
        self.loop = Loop(
            self.world,
            new_medium(self.scenario, self.world, self._traces, self.config.threads),
            acting,
            observers,
            self.scenario.events,
            stop,
            self.live_events,
            cast("TimedBackend", acting) if self._recorded_subtick_s is not None else None,
            *([self.open_interfaces.follow] if self.open_interfaces else []),
        )

    def priority(self) -> AbstractContextManager[None]:
        """In real time the loop goes before other processes within the context; sub-ticks make that worth a message."""
        if self.pace is None:
            return nullcontext()
        return before_other_processes(self.folder.say if self._subtick_s else self.folder.note)

    def entered_loop(self) -> Loop:
        """The loop of a run that has begun; RuntimeError before."""
        if self.loop is None:
            raise RuntimeError(OUTSIDE)
        return self.loop

    @property
    def factor(self) -> float:
        """Simulated s per s of wall time in real time, else 1."""
        return self.pace.factor if self.pace else 1.0

    def stopped(self) -> bool:
        """Whether a person or a signal has asked for the end of the run."""
        return self.interrupt.asked or self.controls.quit_asked

    def wait(self, tick: int) -> None:
        """Return when the tick may begin."""
        self.controls.wait(tick, self.stopped)
        self.status.began()

    def hashes(self) -> list[str]:
        """The trajectory hash of each arena, up to the last tick."""
        return self.loop.hexdigests() if self.loop else []

    def health(self) -> RunnerHealth | None:
        """The state of the runners; None if there are none."""
        return self.backend.health() if isinstance(self.backend, LockstepBackend | RealTimeBackend) else None

    def real_time_report(self) -> RealTimeReport | None:
        """How well the run kept to the wall clock; None in lockstep."""
        backend = self.backend
        return backend.report() if isinstance(backend, PacedBackend | RealTimeBackend | GatewayBackend) else None

    def _check(self) -> None:
        """BadInput for options that do not go together, and for a machine that is too small."""
        config, static = self.config, self.world.static
        robots = static.arenas * static.robots
        if config.threads < 1:
            raise BadInput("--threads", "", f"expected at least 1, got {config.threads}")
        if config.listening is not None:
            config.listening.check(self.scenario, robots)
        check_isolation(self.isolation, self.runners)
        need_open_files(self.runners if config.listening is None else robots)
        if self.runners or config.out is not None:  # else there is no network, and no table
            need_address_space()
            need_threads(self.runners)
        self.gateways.check(static.arenas, self.runners)
        self._interfaces.check(static)
        self.record.check(static)
        if config.listening and config.listening.observed and config.out is None:
            raise BadInput("--observe", "", "expected a run folder with it: a run that leaves none is not published")

    def _new_world(self, seeds: tuple[int, ...]) -> World:
        """Every arena at its start, with the sensors that its agents need."""
        needs = {name: kind.needs for name, kind in check_agents(self.scenario, self.agents).items()}
        needs = self.gateways.sensors(needs, bodies_of(self.scenario, self.scenario.source))
        return World(self.scenario, seeds, needs, self.config.threads)

    def _new_status(self) -> Status:
        return Status(
            run_id=self.run_id,
            scenario=self.scenario.name,
            ticks=self.ticks,
            metrics=self.metrics,
            controls=self.controls,
            clock=self.clock,
            health=self.health,
            counts=lambda: self.loop.counts() if self.loop else {},
            radio=lambda: self.live_events.progress.radio,
            events=self.live_events.listing,
            compiled_ns=self.compiling.total_ns,
        )

    def _new_published(self, folder: Path) -> Published:
        listening, events = self.config.listening, self.live_events
        control = ControlServer(self.status, self.controls, events.submit, events.end, self.folder.note)
        published = Published(
            folder,
            self.run_id,
            self.metrics,
            self.clock,
            selected=self.record.select,
            declare=control.declare,
            door=listening.for_observers(self.run_id) if listening else None,
        )
        self.controls.on_pause = published.catch_up
        return published

    def _from_outside(self, tick: int) -> bool:
        """Whether the actions of this tick need not follow from scenario and seed."""
        replay = self.config.replay
        if replay and replay.inputs:
            return tick >= replay.inputs.first_tick
        if self.foreign_agents or any(event.tick >= 0 for event in self.runner_events):
            return True
        in_real_time = self.pace is not None and (self.runners > 0 or self._subtick_s is not None)
        return bool(self.losses or self.gateways.kinds) or in_real_time

"""One execution of a scenario, tick by tick or to its end."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self, cast

from swarmwire.comms.clock import PreciseClock, WallClock, to_s
from swarmwire.comms.errors import BadInput, Interrupted, RecordFailed
from swarmwire.comms.interfaces import AgentBackend, Observer, StopConditions, TimedBackend
from swarmwire.comms.truth import Static, Truth
from swarmwire.deploy.agents import agent_specs, check_agents
from swarmwire.deploy.arguments import (
    Runners,
    SeedsGiven,
    choose_seeds,
    real_time_factor,
    runner_count,
    scenario_of,
    subtick_of,
    tick_count,
)
from swarmwire.deploy.assemble_result import assemble_result
from swarmwire.deploy.backends import Backends
from swarmwire.deploy.control.control_server import ControlServer, Status
from swarmwire.deploy.controls import Controls
from swarmwire.deploy.endpoint import check_socket, new_run_id
from swarmwire.deploy.gateways.gateways import GatewaysGiven, as_gateways
from swarmwire.deploy.gateways.serving import RunGateways, Served
from swarmwire.deploy.gateways.undriven import Undriven
from swarmwire.deploy.guarded import Guarded
from swarmwire.deploy.interrupt import Interrupt
from swarmwire.deploy.kept_memory import keep_memory
from swarmwire.deploy.listening import Listening
from swarmwire.deploy.live.published import Published
from swarmwire.deploy.measuring import conditions, measuring
from swarmwire.deploy.new_medium import new_medium
from swarmwire.deploy.radio.link_trace_file import scenario_traces
from swarmwire.deploy.record.inputs import ReplayedBackend
from swarmwire.deploy.record.origin import Origin
from swarmwire.deploy.record.recording import Recording
from swarmwire.deploy.record.run_record import RunRecord
from swarmwire.deploy.rehearsal import rehearse
from swarmwire.deploy.replay import Replay
from swarmwire.deploy.result import Result
from swarmwire.deploy.system_limits import need_open_files, need_threads
from swarmwire.deploy.too_large import TooLarge
from swarmwire.metrics.measure import Metrics
from swarmwire.metrics.network.radio_tally import RadioTally
from swarmwire.metrics.run_folder.events import EventLog
from swarmwire.metrics.stop import StopConditions as MetricStopConditions
from swarmwire.world.backends.pacing import Pace
from swarmwire.world.backends.realtime_backend import PacedBackend, RealTimeBackend
from swarmwire.world.backends.registry import Loss, RunnerEvent, RunnerHealth
from swarmwire.world.backends.zenoh_backend import LockstepBackend
from swarmwire.world.gateways.backend import GatewayBackend
from swarmwire.world.live_events import LiveEvents
from swarmwire.world.loop import Loop
from swarmwire.world.scenario.bodies import bodies_of, custom_code
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.subtick import Subticks
from swarmwire.world.world import World


class Simulation:
    """A scenario, checked and ready; entered, it has its agents and can be stepped; left, it has a result.

    So::

        with Simulation("scenario.toml", seed=3) as simulation:
            while simulation.tick < 100:
                truth = simulation.step()
        print(simulation.result.metrics["order"].final)

    The arguments are those of `swarmwire.deploy.run`, and so are the errors. `replay` says what a run that is repeated
    takes from its record. `listening` is where the world waits for runners that others start, in place of `runners`.

    Attributes:
        scenario: as checked.
        world: every arena's bodies and sensors; do not move it by hand.
        metrics: what was measured up to the last tick, in `metrics.latest`.
        ticks: of the whole run.
        runners: processes that run the agents; 0: none, they are in this one.
        agents: the spec of each group's agent.
        code: the specs of all classes of users': agents, custom sensors, actuators and metrics.
        inputs: of a run that is repeated, what came into it from outside.
        interrupt: entered, SIGINT, SIGTERM or SIGHUP ends `run` after the tick under way.
        judge: says which arenas are over, by the scenario's stop conditions; another may take its place before the run.
        controls: pause, step, speed and end of `run`, for other threads.
        live_events: events given while it goes on, and ended, from any thread.
        served: entered, the robots that answer as real ones, if any.
    """

    def __init__(
        self,
        scenario: Scenario | Path | str,
        *,
        seed: int | None = None,
        seeds: SeedsGiven | None = None,
        runners: Runners = None,
        overrides: Sequence[str] = (),
        out: Path | str | None = None,
        observers: Sequence[Observer] = (),
        socket: Path | None = None,
        realtime: float | str | None = None,
        subtick: float | None = None,
        record: Recording | None = None,
        gateways: GatewaysGiven = None,
        replay: Replay | None = None,
        listening: Listening | None = None,
    ) -> None:
        self._clock = WallClock()
        self._called_ns = self._clock.now_ns()
        self.scenario = scenario_of(scenario, overrides)
        self._behind = RunGateways(as_gateways(gateways), self.scenario)
        factor = self._behind.factor(real_time_factor(realtime))
        self._subtick_s = subtick_of(subtick, factor, self.scenario)
        self.agents = agent_specs(self.scenario)
        self.world = self._new_world(seed, seeds)
        measures = measuring(self.scenario)
        self.metrics = Metrics(measures.metrics)
        stops = conditions(self.scenario)
        self._stop = MetricStopConditions(self.metrics, stops) if stops else None
        self.stop_conditions: StopConditions | None = self._stop
        self.code = tuple(dict.fromkeys([*self.agents.values(), *custom_code(self.world.static), *measures.code]))
        self._traces = scenario_traces(self.scenario)
        self.ticks = replay.ticks if replay else tick_count(self.scenario)
        self.inputs = replay.inputs if replay else None
        robots = self.static.arenas * self.static.robots
        self.runners = runner_count(runners, robots)
        if listening is not None:
            listening.check(self.scenario, robots)
            self.runners = 1  # at least; how many there were is told once it is over
        need_open_files(self.runners if listening is None else robots)
        if self.runners or out is not None:  # else there is no network, and no table
            need_threads(self.runners)
        self._behind.check(self.static.arenas, self.runners)
        what = record or Recording()
        what.check(self.static)
        if self.runners and socket is not None:
            check_socket(socket)
        # Only now a folder: what is refused leaves none.
        self._record = RunRecord(None if out is None else Path(out), self._clock)
        rate_hz = self.scenario.time.rate_hz
        clock = PreciseClock(self._clock) if self._subtick_s else self._clock
        self._pace = None if factor is None else Pace(clock, rate_hz, factor, self._record.say)
        self._recorded_subtick_s = replay.subtick_s if replay else self._subtick_s
        self.controls = Controls(self._clock, rate_hz, self._pace, speed_fixed=bool(self._behind.kinds))
        self.run_id, self.interrupt = new_run_id(), Interrupt()
        self.live_events = LiveEvents(
            self.scenario,
            {group.name: group.body for group in self.static.groups},
            self._record.keep,
            replay.live_events if replay else None,
        )
        self._status = self._new_status()
        self._observers: list[Guarded] = []
        self._listens, self._observed = listening is not None, bool(listening and listening.observed)
        for observer in (TooLarge(self._record.say), *self._recorders(what, listening), *observers):
            self.watch(observer)
        self._losses: list[Loss] = []
        self._changes: list[RunnerEvent] = []
        self._not_its_own = False  # whether it began with robots that had no agent, or code of a foreign runner
        self.served: Served | None = None
        self._backends = self._new_backends(socket, listening)
        self._backend: AgentBackend | None = None
        self._loop: Loop | None = None
        self._result: Result | None = None

    @property
    def folder(self) -> Path | None:
        """The run folder, if any."""
        return self._record.folder

    @property
    def record_failed(self) -> RecordFailed | None:
        """Why the run folder has no summary, once the run is over; None if it has one, or there is no folder."""
        return self._record.failed

    @property
    def static(self) -> Static:
        """What does not change during the run."""
        return self.world.static

    @property
    def tick(self) -> int:
        """Ticks done so far; also the number of the next one."""
        return self._loop.ticks_done if self._loop else 0

    @property
    def result(self) -> Result:
        """What came of the run, once it is over; RuntimeError before."""
        if self._result is None:
            raise RuntimeError("the run is not over yet: leave the `with` block first")
        return self._result

    def hashes(self) -> list[str]:
        """The trajectory hash of each arena, up to the last tick."""
        return self._loop.hexdigests() if self._loop else []

    def watch(self, observer: Observer) -> None:
        """Add an observer, before the run begins; if it fails, it is counted and left out."""
        self._observers.append(Guarded(observer, self._record.say))

    def __enter__(self) -> Self:
        """Start the agents; AgentFailed or RunnerLost if that fails."""
        if self._loop is not None:
            raise RuntimeError("a simulation runs once; make another one")
        keep_memory()
        with ExitStack() as stack:
            stack.push(self._record.failed_to_start)
            self._origin = self._begin_record()
            if self._pace:  # before anything answers, and the pace begins
                world = self._new_world(None, self.static.seeds)
                rehearse(world, new_medium(self.scenario, world, self._traces), self.metrics.metrics)
            pace = self._pace.factor if self._pace else 1.0
            served = self._behind.served(self.world, self.agents, self._clock, pace, self.folder, self._record.say)
            self.served = stack.enter_context(served)
            if self._published and self._observed:  # what cannot be had is refused before anybody joins
                stack.callback(self._published.close)
                self._published.open()
            backend = self._backend = stack.enter_context(self._backends.backend(self.served))
            judging = [self._stop] if self._stop else []
            looking = [self.metrics, *judging, self._status, RadioTally(), EventLog()]
            self._watching: list[Observer] = [*looking, *self._observers]
            if self.served:
                self._watching.append(Undriven(self.served, pace, self._record.say))
            self._loop = self._new_loop(backend)
            self._start(backend)
            self._exit = stack.pop_all()
        self._started_ns = self._clock.now_ns()
        return self

    def step(self) -> Truth:
        """One tick; what the observers saw of it. It may go on beyond the scenario's duration."""
        return self._entered().step()

    def apply_event(self, event: Mapping[str, Any]) -> int:
        """Have an event happen at the start of the next tick: a table as in a scenario, without at_s. Its number.

        BadInput says what is wrong with it. `live_events.end` undoes one that lasts.
        """
        return self.live_events.give(event)

    def run(self, ticks: int | None = None) -> None:
        """Run up to tick `ticks`, or to the scenario's end, until all arenas have stopped, or until an interrupt."""
        loop = self._entered()
        with suppress(Interrupted):  # asked for while it waited for runners: the summary says how far it came
            until = self.ticks if ticks is None else ticks
            loop.run(until, self._stopped, self._hold)

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """End the agents, and close the records with a summary: also of a run that failed, when it is worth most."""
        loop, ended_ns = self._entered(), self._clock.now_ns()
        with self._exit:
            last = loop.end()
            parts: dict[str, Any] = {}
            for observer in self._watching:
                parts.update(observer.end(last))
            failed = {f"observer_failed_{observer.name}": 1 for observer in self._observers if observer.failed}
            backend = self._backend
            self._result = assemble_result(
                self.static,
                parts,
                ended=self._ended(error),
                error=error,
                runners=max(self.runners, len({change.runner for change in self._changes})),
                ticks=loop.ticks_done,
                arena_ticks=loop.arena_ticks.tolist(),
                stopped=(~self.world.running).tolist(),
                hashes=loop.hexdigests(),
                wall_s=to_s(ended_ns - self._started_ns - self.controls.paused_ns),
                start_s=to_s(self._started_ns - self._called_ns),
                counts={**loop.counts(), **failed},
                arena_counts=loop.arena_counts(),
                origin=self._origin,
                inputs=self._record.inputs(),
                live_events=self._record.live_events(),
                losses=self._losses,
                changes=self._changes,
                engines=self.world.engines,
                realtime=backend.report()
                if isinstance(backend, PacedBackend | RealTimeBackend | GatewayBackend)
                else None,
                folder=self.folder,
            )
        self._record.close(self._result)

    def health(self) -> RunnerHealth | None:
        """How the runners are doing; None if there are none."""
        return self._backend.health() if isinstance(self._backend, LockstepBackend | RealTimeBackend) else None

    @property
    def _early(self) -> list[Observer]:
        """Those through which people see and control a run that still waits for its agents."""
        return [of for of in self._watching if of.before_agents]

    def _begin_record(self) -> Origin:
        """Write down what is about to run, before anything does."""
        return self._record.begin(
            self.scenario,
            self.code,
            self.static.seeds,
            ticks=self.ticks,
            runners=self.runners,
            realtime=self._pace.factor if self._pace else None,
            subtick_s=self._recorded_subtick_s,
            gateways=self._behind.kinds,
            metrics=self.metrics,
        )

    def _new_loop(self, backend: AgentBackend) -> Loop:
        """The loop over world, air and backend, whose actions are kept where they need not follow from the seed."""
        rows = self.static.arenas * self.static.robots
        acting = backend if self.inputs is None else ReplayedBackend(backend, self.inputs, rows, self.static.rate_hz)
        acting = self._record.recorded(acting, self._from_outside)
        return Loop(
            self.world,
            new_medium(self.scenario, self.world, self._traces),
            acting,
            self._watching,
            self.scenario.events,
            self.stop_conditions,
            self.live_events,
            cast("TimedBackend", acting) if self._recorded_subtick_s is not None else None,
        )

    def _start(self, backend: AgentBackend) -> None:
        """Have the backend ready, and all who look on begin: some before, since people want to see who is missing."""
        early = self._early if self._listens else []
        with ExitStack() as unless_begun:
            for observer in early:
                observer.begin(self.static)
                unless_begun.callback(observer.end, None)
            backend.start()
            unless_begun.pop_all()
        self._not_its_own = bool((health := self.health()) and (health.robots_free or health.foreign))
        for observer in self._watching:
            if observer not in early:
                observer.begin(self.static)

    def _new_world(self, seed: int | None, seeds: SeedsGiven | None) -> World:
        """Every arena at its start, with the sensors that its agents need."""
        needs = {name: kind.needs for name, kind in check_agents(self.scenario, self.agents).items()}
        needs = self._behind.sensors(needs, bodies_of(self.scenario, self.scenario.source))
        return World(self.scenario, choose_seeds(self.scenario, seed, seeds), needs)

    def _recorders(self, what: Recording, listening: Listening | None) -> Sequence[Observer]:
        """Those that fill the run folder, which may drop something only where the run keeps to the wall clock."""
        may_drop = self._pace is not None
        given = self.live_events
        if self._observed and self.folder is None:
            raise BadInput("--observe", "", "expected a run folder with it: a run that leaves none is not published")
        door = listening.observers_door(self.run_id) if listening else None
        control = ControlServer(self._status, self.controls, given.give, given.end, self._record.note)
        found = self._record.observers(
            what, self.run_id, self.metrics, self.hashes, control, may_drop=may_drop, door=door
        )
        self._published = next((of for of in found if isinstance(of, Published)), None)
        if self._published:
            self.controls.on_pause = self._published.catch_up
        return found

    def _new_status(self) -> Status:
        """What tells how the run is doing."""
        return Status(
            run_id=self.run_id,
            scenario=self.scenario.name,
            ticks=self.ticks,
            metrics=self.metrics,
            controls=self.controls,
            clock=self._clock,
            health=self.health,
            counts=lambda: self._loop.counts() if self._loop else {},
            radio=lambda: self.live_events.progress.radio,
            events=self.live_events.told,
        )

    def _hold(self, tick: int) -> None:
        """Return when the tick may begin."""
        self.controls.hold(tick, self._stopped)
        self._status.began()

    def _new_backends(self, socket: Path | None, listening: Listening | None) -> Backends:
        """How the agents will be started."""
        return Backends(
            scenario=self.scenario,
            static=self.static,
            agents=self.agents,
            runners=self.runners,
            run_id=self.run_id,
            clock=self._clock,
            pace=self._pace,
            socket=socket,
            stopped=self._stopped,
            listening=listening,
            lost=self._losses.append,
            changed=self._changes.append,
            say=self._record.say,
            subticks=Subticks(self._clock, self._pace, self.static.rate_hz, self._subtick_s)
            if self._pace and self._subtick_s
            else None,
        )

    def _from_outside(self, tick: int) -> bool:
        """Whether the actions of this tick need not follow from scenario and seed."""
        if self.inputs is not None:
            return tick >= self.inputs.first_tick
        if self._not_its_own or any(change.tick >= 0 for change in self._changes):
            return True
        in_real_time = self._pace is not None and (self.runners > 0 or self._subtick_s is not None)
        return bool(self._losses or self._behind.kinds) or in_real_time

    def _stopped(self) -> bool:
        return self.interrupt.asked or self.controls.quit_asked

    def _entered(self) -> Loop:
        if self._loop is None or self._result is not None:
            raise RuntimeError("a simulation is stepped within its `with` block")
        return self._loop

    def _ended(self, error: BaseException | None) -> str:
        if isinstance(error, KeyboardInterrupt | Interrupted):
            return "interrupted"
        if error is not None:
            return "failed"
        if not self.world.running.any():
            return "stopped"
        if self.tick >= self.ticks:
            return "duration"
        return "interrupted" if self._stopped() else "left"

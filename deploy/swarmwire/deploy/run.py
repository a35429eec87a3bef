"""One execution of a scenario: wires the parts together, runs the loop, and gives back what came of it."""

import sys
from collections.abc import Generator, Sequence
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from swarmwire.agent.local_crew import LocalCrew
from swarmwire.comms.air.air import Air
from swarmwire.comms.assignment import Assignment
from swarmwire.comms.clock import WallClock, tick_start_ns, to_ns, to_s
from swarmwire.comms.errors import BadInput, Interrupted
from swarmwire.comms.geometry import obstacle_arrays
from swarmwire.comms.protocols import Crew, Observer
from swarmwire.deploy import machine
from swarmwire.deploy.agents import agent_specs, check_agents
from swarmwire.deploy.endpoint import local_endpoint, new_run_id
from swarmwire.deploy.folder import make_folder
from swarmwire.deploy.guarded import Guarded
from swarmwire.deploy.inputs import RecordedCrew, RecordedInputs, ReplayedCrew
from swarmwire.deploy.interrupt import Interrupt
from swarmwire.deploy.modules import module_digests
from swarmwire.deploy.origin import Origin
from swarmwire.deploy.result import EventResult, Result, arena_result
from swarmwire.deploy.runner_processes import RunnerProcesses
from swarmwire.deploy.scenario_copy import CopiedFile, copy_scenario
from swarmwire.metrics.event_log import EventLog
from swarmwire.metrics.metrics import Metrics
from swarmwire.metrics.radio_tally import RadioTally
from swarmwire.metrics.rerun_recording import RerunRecording
from swarmwire.world import assignments
from swarmwire.world.loop import Loop
from swarmwire.world.pace import Pace
from swarmwire.world.realtime_crew import PacedCrew, RealTimeCrew, RealTimeReport
from swarmwire.world.remote_crew import RemoteCrew
from swarmwire.world.roster import Loss
from swarmwire.world.runner_crew import Surroundings
from swarmwire.world.scenario import Scenario
from swarmwire.world.scenario_file import load_scenario
from swarmwire.world.world import World

FASTEST = 1e6  # factor in real time
GLOBAL_SENSES = ("compass", "positioning")
Runners = int | str | None  # how many, "per-robot", or None for a local crew


def run(
    scenario: Scenario | Path | str,
    *,
    seed: int | None = None,
    seeds: Sequence[int] | None = None,
    runners: Runners = None,
    overrides: Sequence[str] = (),
    out: Path | str | None = None,
    observers: Sequence[Observer] = (),
    socket: Path | None = None,
    realtime: float | None = None,
) -> Result:
    """Run a scenario and return its result; with `seeds`, one arena per seed, side by side in one world.

    `runners` is None (all agents in this process), a number of runner processes, or "per-robot". `overrides` are
    "path=value" as for `--set`. With `out`, a new or empty folder, `summary.json` and `run.rrd` are written there.
    `realtime` keeps the run to the wall clock, so many simulated seconds per second, and waits for no runner; None runs
    as fast as the machine allows.

    Raises BadInput for anything wrong with the scenario or these arguments, AgentFailed with the agent's traceback, and
    RunnerLost if a runner's process or link is gone.
    """
    checked = scenario if isinstance(scenario, Scenario) else load_scenario(scenario, overrides)
    if isinstance(scenario, Scenario) and overrides:
        raise BadInput("overrides", "", "expected a path of a scenario; a Scenario is complete as it is")
    execution = Execution(checked, choose_seeds(checked, seed, seeds), runners, socket, realtime)
    if out is not None:
        execution.folder = make_folder(Path(out))
    return execution.run(observers)


class Execution:
    """A checked scenario on its way to a result."""

    def __init__(
        self,
        scenario: Scenario,
        seeds: tuple[int, ...],
        runners: Runners = None,
        socket: Path | None = None,
        realtime: float | str | None = None,
    ) -> None:
        self.scenario, self.seeds = scenario, seeds
        self._factor = None if realtime is None else _factor(realtime)
        self._losses: list[Loss] = []
        self.folder: Path | None = None  # where summary and recording go, if anywhere
        self.inputs: RecordedInputs | None = None  # of a run that is repeated
        self.recording: dict[str, Any] = {}  # options that change what is recorded, never what happens
        self.ticks = _ticks(scenario)
        self.run_id = new_run_id()
        self._socket, self._clock = socket, WallClock()
        self._called_ns = self._clock.now_ns()
        self.specs = agent_specs(scenario)
        needs = {name: kind.needs for name, kind in check_agents(scenario, self.specs).items()}
        self.world = World(scenario, seeds, needs)
        self.runners = _runner_count(runners, self.world.static.arenas * self.world.static.robots)

    def run(self, observers: Sequence[Observer] = ()) -> Result:
        """Run to the end of the scenario, or until an interrupt."""
        modules = module_digests(self.specs.values())
        files = self._keep(modules)
        metrics = Metrics()
        recorders: list[Observer] = [RerunRecording(self.folder / "run.rrd", metrics)] if self.folder else []
        guarded = [Guarded(observer) for observer in (*recorders, *observers)]
        watching: list[Observer] = [metrics, RadioTally(), EventLog(), *guarded]
        parts: dict[str, Any] = {}
        with Interrupt() as interrupt, self._crew(interrupt) as crew:
            recorded = RecordedCrew(crew, self.folder, self._outside) if self.folder else None
            loop = Loop(self.world, self.air(), recorded or crew, watching, self.scenario.events)
            crew.start()
            for observer in watching:
                observer.begin(self.world.static)
            started_ns = self._clock.now_ns()
            try:
                loop.run(self.ticks, stopped=lambda: interrupt.asked)
            except Interrupted:
                pass  # the summary says how far it came
            finally:  # also of a run that failed: a recording is worth most then
                ended_ns = self._clock.now_ns()
                last = loop.end()
                for observer in watching:
                    parts.update(observer.end(last))
            report = crew.report() if isinstance(crew, PacedCrew | RealTimeCrew) else None
        failed = {f"observer_failed_{observer.name}": 1 for observer in guarded if observer.failed}
        result = self._result(loop, parts, {**loop.counts(), **failed}, started_ns, ended_ns, report)
        result = replace(result, modules=modules, files=files, inputs=recorded.record() if recorded else None)
        if self.folder:
            result.write(self.folder / "summary.json")
        return result

    def _keep(self, modules: dict[str, str]) -> tuple[CopiedFile, ...]:
        """Put into the run folder, before anything happens, what the run needs to be repeated."""
        if self.folder is None:
            return ()
        files = copy_scenario(self.scenario, self.seeds, self.folder)
        Origin(
            seeds=self.seeds,
            ticks=self.ticks,
            runners=self.runners,
            realtime=self._factor,
            recording=self.recording,
            files=files,
            modules=modules,
            cpu=machine.cpu(),
            versions=machine.versions(),
        ).write(self.folder)
        return files

    def _outside(self, tick: int) -> bool:
        """Whether the actions of this tick need not follow from scenario and seed."""
        if self.inputs is not None:
            return tick >= self.inputs.first_tick
        return bool(self._losses) or (self._factor is not None and self.runners > 0)

    def air(self) -> Air | None:
        """The air of the scenario's radio, if it has one."""
        static, radio = self.world.static, self.scenario.radio
        if radio is None:
            return None
        obstacles = obstacle_arrays(static.obstacles)
        size_m, every = static.arena_size_m, static.act_every_ticks
        return Air(radio, self.world.keys, static.robots, size_m, obstacles, static.rate_hz, every)

    @contextmanager
    def _crew(self, interrupt: Interrupt) -> Generator[Crew]:
        whole = assignments.whole(self.scenario, self.world.static, self.specs)
        if not self.runners:
            with closing(LocalCrew(whole)) as local:
                if self.inputs is not None:
                    yield ReplayedCrew(local, self.inputs)
                else:
                    yield local if self._factor is None else PacedCrew(local, self._pace(self._factor))
            return
        parts = assignments.split(whole, self.runners)
        names = [f"r{i}" for i in range(len(parts))]
        processes: list[RunnerProcesses] = []

        def trouble() -> str | None:
            return processes[0].trouble() if processes else None

        with local_endpoint(self._socket) as endpoint:
            around = Surroundings(trouble, lambda: interrupt.asked, lambda loss: self._survive(loss, endpoint))
            crew = self._remote_crew(endpoint, parts, around)
            try:
                crew.open()
                processes.append(RunnerProcesses(endpoint, self.run_id, sorted(set(self.specs.values())), names))
                yield crew
            finally:
                crew.close()
                for process in processes:
                    process.stop()

    def _remote_crew(self, endpoint: str, parts: list[Assignment], around: Surroundings) -> RemoteCrew | RealTimeCrew:
        table = self.scenario.run
        common = endpoint, self.run_id, parts, table.runner_timeout_s, self._clock, around, table.on_runner_loss
        if self._factor is None:
            return RemoteCrew(*common)
        return RealTimeCrew(*common, self._pace(self._factor), table.watchdog_s)

    def _pace(self, factor: float) -> Pace:
        return Pace(self._clock, self.scenario.time.rate_hz, factor, _say)

    def _survive(self, loss: Loss, endpoint: str) -> None:
        """Tell people of a runner that was lost, and of what they can do."""
        self._losses.append(loss)
        if self.scenario.run.on_runner_loss == "dead":
            _say(f"lost runner {loss}; its robots stand still")
            return
        agents = ",".join(sorted(set(self.specs.values())))
        takeover = f"python -m swarmwire.agent.nursery {endpoint} {self.run_id} {agents} NAME"
        _say(f"lost runner {loss}; waiting for another, such as: {takeover}")

    def _result(
        self,
        loop: Loop,
        parts: dict[str, Any],
        counts: dict[str, int],
        started_ns: int,
        ended_ns: int,
        report: RealTimeReport | None,
    ) -> Result:
        static = self.world.static
        radios: list[Any] = parts.get("radio", [None] * static.arenas)
        arenas = zip(static.seeds, loop.hexdigests(), radios, parts["metrics"], strict=True)
        senses = {group.body.name: [s for s in GLOBAL_SENSES if s in group.body.senses] for group in static.groups}
        return Result(
            scenario=static.name,
            robots=static.robots,
            runners=self.runners,
            mode="realtime" if report else "lockstep" if self.runners else "local",
            ended="duration" if loop.ticks_done == self.ticks else "interrupted",
            ticks=loop.ticks_done,
            sim_time_s=to_s(tick_start_ns(loop.ticks_done, static.rate_hz)),
            wall_time_s=to_s(ended_ns - started_ns),
            start_time_s=to_s(started_ns - self._called_ns),
            arenas=tuple(arena_result(*arena) for arena in arenas),
            events=tuple(EventResult(**event) for event in parts["events"]),
            global_senses={body: found for body, found in senses.items() if found},
            counts=counts,
            cpu=machine.cpu(),
            versions=machine.versions(),
            modules={},
            lost_runners=tuple(str(loss) for loss in self._losses),
            realtime=report,
            out=self.folder,
        )


def _ticks(scenario: Scenario) -> int:
    """Ticks that start before the scenario's duration is over; the first always does."""
    return max(1, -(-to_ns(scenario.duration_s) * scenario.time.rate_hz // 10**9))


def _say(text: str) -> None:
    """Something that people should know at once, while a run goes on."""
    print(text, file=sys.stderr, flush=True)


def _factor(realtime: float | str) -> float:
    try:
        factor = float(realtime)
    except ValueError:
        factor = 0.0
    if not 0 < factor <= FASTEST:
        raise BadInput("--realtime", "", f"expected a factor above 0 and at most {FASTEST:g}, got {realtime!r}")
    return factor


def choose_seeds(scenario: Scenario, seed: int | None, seeds: Sequence[int] | None) -> tuple[int, ...]:
    """The seed of each arena: those asked for, or the scenario's own; BadInput if they are no good."""
    if seed is not None and seeds is not None:
        raise BadInput("", "seeds", "expected either one seed or several seeds")
    chosen = tuple(seeds) if seeds is not None else (scenario.seed if seed is None else seed,)
    if not chosen or len(set(chosen)) != len(chosen) or min(chosen) < 0:
        raise BadInput("", "seeds", f"expected different whole numbers of at least 0, got {list(chosen)}")
    return chosen


def _runner_count(runners: Runners, robots: int) -> int:
    if runners is None or runners == "none":
        return 0
    if runners == "per-robot":
        return robots
    if isinstance(runners, str) and runners.isdecimal():
        runners = int(runners)
    if isinstance(runners, str | bool) or not 1 <= runners <= robots:
        raise BadInput("--runners", "", f'expected "none", "per-robot" or 1 to {robots} (the robots), got {runners!r}')
    return runners

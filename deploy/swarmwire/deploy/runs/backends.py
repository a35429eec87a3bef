"""The agent backends of a run, one function for each kind, and a log of its runners.

- `local_backend`: agents in this process.
- `gateway_backend`: robots that answer as real ones, next to agents in this process.
- `runner_backend`: processes of this machine, which the run starts.
- `joined_backend`: runners that others start, here or on other machines.
"""

import hashlib
from collections.abc import Callable, Generator, Mapping
from contextlib import AbstractContextManager, closing, contextmanager
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

from swarmwire.agent.agent import agent_sha256, load_agent
from swarmwire.agent.agent_group import layout_of
from swarmwire.agent.local_backend import LocalBackend
from swarmwire.comms.base.clock import Clock
from swarmwire.comms.observe.interfaces import AgentBackend
from swarmwire.comms.wire.assignment import Assignment, robots_text
from swarmwire.comms.wire.join import GroupInfo, SessionInfo
from swarmwire.deploy.runs.config import Listening
from swarmwire.deploy.runs.gateways.serving import Served
from swarmwire.deploy.runs.live_address import local_endpoint
from swarmwire.deploy.runs.plan import Plan
from swarmwire.deploy.runs.runners import AGENT_HOST, RunnerProcesses
from swarmwire.world.backends.allocation import full_assignment
from swarmwire.world.backends.join_policy import JoinPolicy, ListenSettings
from swarmwire.world.backends.lockstep import Lockstep
from swarmwire.world.backends.pacing import Pace
from swarmwire.world.backends.realtime import RealTime
from swarmwire.world.backends.realtime_backend import PacedBackend, RealTimeBackend, RealTimeReport
from swarmwire.world.backends.runner_reports import Loss, RunnerEvent, RunnerHealth
from swarmwire.world.backends.zenoh_backend import SILENT_S, BackendHooks, LockstepBackend
from swarmwire.world.gateways.backend import GatewayBackend
from swarmwire.world.subtick import Subticks

ANSWER_SHARE = 0.8  # share of a real-time tick after which an agent host answers without its late processes
REPLACEABLE = ("wait", "stand", "coast")  # values of run.on_runner_loss with which another runner may take over

RemoteBackend = LockstepBackend | RealTimeBackend
Report = Callable[[str], None]  # prints and logs a message


class RunnerLog:
    """The runners that a run has lost, and all events of its runners, in order; new ones are reported."""

    def __init__(self, report: Report) -> None:
        self.losses: list[Loss] = []
        self.events: list[RunnerEvent] = []
        self.report = report

    def add_loss(self, loss: Loss) -> None:
        """Add a loss that the run survives."""
        self.losses.append(loss)
        if loss.traceback:
            self.report(loss.traceback.rstrip())

    def add_refusal(self, runner: str, reason: str) -> None:
        """Report a runner that was not admitted."""
        self.report(f"refused {runner!r}: {reason}")


@dataclass(frozen=True)
class BackendSettings:
    """The inputs of every kind of backend."""

    plan: Plan
    run_id: str
    clock: Clock
    pace: Pace | None  # None: as fast as possible
    subticks: Subticks | None  # None: packets cross at the starts of ticks
    log: RunnerLog
    is_stopped: Callable[[], bool]  # True if the run must end

    def assignment(self) -> Assignment:
        """Return the assignment of all robots to one runner."""
        return full_assignment(self.plan.scenario, self.plan.static, dict(self.plan.agents))


def open_backend(settings: BackendSettings, served: Served | None) -> AbstractContextManager[AgentBackend]:
    """Return the backend that the plan needs, ended with the context; `served` robots run no agent."""
    if served and settings.pace:
        return gateway_backend(settings, settings.pace, served)
    if settings.plan.config.listening is not None:
        return joined_backend(settings, settings.plan.config.listening)
    return runner_backend(settings) if settings.plan.runners else local_backend(settings)


@contextmanager
def local_backend(settings: BackendSettings) -> Generator[AgentBackend]:
    """Run all agents in this process."""
    with closing(LocalBackend(settings.assignment())) as local:
        yield PacedBackend(local, settings.pace, settings.subticks) if settings.pace else local


@contextmanager
def gateway_backend(settings: BackendSettings, pace: Pace, served: Served) -> Generator[AgentBackend]:
    """Pass on the commands of programs to served robots, and run the agents of all others in this process."""
    names, assignment = {group.name for group in served.groups}, settings.assignment()
    others = replace(assignment, groups=tuple(group for group in assignment.groups if group.name not in names))
    with closing(LocalBackend(others)) as local:
        yield GatewayBackend(
            local, served.groups, served.medium, pace, served.show, served.show_counts, settings.subticks
        )


@contextmanager
def runner_backend(settings: BackendSettings) -> Generator[AgentBackend]:
    """Run the agents in processes of this machine, which end with the context."""
    plan, log = settings.plan, settings.log
    specs = sorted(set(plan.agents.values()))
    processes: list[RunnerProcesses] = []

    with local_endpoint() as endpoint:
        takeover = f"python -m {AGENT_HOST} {endpoint} {settings.run_id} {','.join(specs)} NAME 1"

        def lose(loss: Loss) -> None:
            log.add_loss(loss)
            log.report(f"lost runner {loss}{_remedy(settings, takeover)}")

        def change(event: RunnerEvent, _: tuple[str, ...]) -> None:
            log.events.append(event)
            if event.what != "lost":  # `lose` reports a loss, with a remedy
                log.report(str(event))

        hooks = BackendHooks(
            failure=lambda: processes[0].failure() if processes else None,
            stopped=settings.is_stopped,
            lost=lose,
            changed=change,
            refused=log.add_refusal,
            waiting=lambda free: log.report(f"{_waiting(free)}, such as: {takeover}"),
        )
        backend = _remote_backend(settings, endpoint, hooks)
        try:
            backend.open()
            processes.append(
                RunnerProcesses(
                    endpoint,
                    settings.run_id,
                    specs,
                    plan.runners,
                    is_lockstep=settings.pace is None,
                    isolation=plan.isolation,
                )
            )
            yield backend
        finally:
            backend.close()
            for process in processes:
                process.stop()


@contextmanager
def joined_backend(settings: BackendSettings, listening: Listening) -> Generator[AgentBackend]:
    """Wait for runners that others start."""
    log, observer = settings.log, listening.observer

    def change(event: RunnerEvent, free: tuple[str, ...]) -> None:
        log.events.append(event)
        log.report(str(event))
        observer.changed(event, free)

    def refuse(runner: str, reason: str) -> None:
        log.add_refusal(runner, reason)
        observer.refused(runner, reason)

    def wait(free: tuple[str, ...]) -> None:
        log.report(_waiting(free))
        observer.waiting(free)

    hooks = BackendHooks(
        stopped=settings.is_stopped,
        lost=log.add_loss,
        changed=change,
        refused=refuse,
        opened=lambda endpoints: observer.opened(endpoints, settings.run_id),
        waiting=wait,
        silent=lambda runner: log.report(f"no answer for {SILENT_S:g} s from {runner}: the run waits"),
    )
    with closing(_remote_backend(settings, listening.for_agents(settings.run_id), hooks)) as backend:
        backend.open()
        yield backend


def runner_health(backend: AgentBackend) -> RunnerHealth | None:
    """Return the state of the runners; None without runners."""
    return backend.health() if isinstance(backend, RemoteBackend) else None


def real_time_report(backend: AgentBackend) -> RealTimeReport | None:
    """Return how well the run kept to the wall clock; None in lockstep."""
    return backend.report() if isinstance(backend, PacedBackend | RealTimeBackend | GatewayBackend) else None


def _remote_backend(settings: BackendSettings, listen: ListenSettings | str, hooks: BackendHooks) -> RemoteBackend:
    run, pace, robots = settings.plan.scenario.run, settings.pace, [settings.assignment()]
    policy, timeout_s, on_loss = _join_policy(settings), run.runner_timeout_s, run.on_runner_loss
    if pace:
        registry = RealTime(robots, run.watchdog_s, timeout_s, on_loss, policy, subtick=settings.subticks is not None)
        return RealTimeBackend(listen, settings.run_id, registry, timeout_s, hooks, pace, settings.subticks)
    return LockstepBackend(listen, settings.run_id, Lockstep(robots, on_loss, policy), timeout_s, settings.clock, hooks)


def _join_policy(settings: BackendSettings) -> JoinPolicy:
    """Return the terms on which runners join."""
    plan, factor = settings.plan, settings.pace.factor if settings.pace else None
    run, listening = plan.scenario.run, plan.config.listening
    kinds = {group: load_agent(spec) for group, spec in plan.agents.items()}
    memory = {group: layout_of(kind) for group, kind in kinds.items()} if run.on_runner_loss in REPLACEABLE else None
    answer_within_s = None if factor is None else ANSWER_SHARE / (factor * plan.static.rate_hz)
    if listening is None:
        return JoinPolicy(memory=memory, timeout_s=run.runner_timeout_s, answer_within_s=answer_within_s)
    return JoinPolicy(
        _session_info(settings, factor, {group: agent_sha256(kind) for group, kind in kinds.items()}),
        True,
        listening.start_with,
        listening.limits,
        memory,
        run.runner_timeout_s,
        answer_within_s,
    )


def _session_info(settings: BackendSettings, factor: float | None, agent_hashes: Mapping[str, str]) -> SessionInfo:
    """Return the description of the run for runners that may join; `agent_hashes` by group."""
    scenario, static = settings.plan.scenario, settings.plan.static
    return SessionInfo(
        run=settings.run_id,
        scenario=scenario.name,
        scenario_sha256=_file_sha256(scenario.source),
        swarmwire=version("swarmwire-deploy"),
        rate_hz=static.rate_hz,
        real_time=factor,
        groups=tuple(
            GroupInfo(
                name=group.name,
                agent=scenario.robots[group.name].agent,
                agent_sha256=agent_hashes[group.name],
                robots=(group.stop - group.start) * static.arenas,
                free=(),
            )
            for group in static.groups
        ),
    )


def _remedy(settings: BackendSettings, takeover: str) -> str:
    """Return the end of a message about a lost runner."""
    on_loss = settings.plan.scenario.run.on_runner_loss
    if on_loss == "dead":
        return "; its robots stand still"
    is_announced = on_loss == "wait" and settings.pace is None  # the hook `waiting` prints the command then
    return "" if is_announced else f"; another may take over, such as: {takeover}"


def _waiting(free: tuple[str, ...]) -> str:
    return f"waiting for a runner of {robots_text(free)}"


def _file_sha256(source: str) -> str:
    """Return the hash of the scenario's file; "" if the scenario was made in Python."""
    path = Path(source)
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""

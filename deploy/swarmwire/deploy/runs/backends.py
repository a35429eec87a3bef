"""The agent backend of a run: agents in this process, runners of this machine, or runners that others start."""

import hashlib
from collections.abc import Callable, Generator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

from swarmwire.agent.agent import agent_sha256, load_agent
from swarmwire.agent.agent_group import layout_of
from swarmwire.agent.isolation import Isolation
from swarmwire.agent.local_backend import LocalBackend
from swarmwire.comms.base.clock import Clock
from swarmwire.comms.observe.interfaces import AgentBackend
from swarmwire.comms.observe.truth import Static
from swarmwire.comms.wire.assignment import Assignment, robots_text
from swarmwire.comms.wire.join import GroupInfo, SessionInfo
from swarmwire.deploy.runs.config import Listening
from swarmwire.deploy.runs.gateways.serving import Served
from swarmwire.deploy.runs.runners import AGENT_HOST, RunnerProcesses, local_endpoint
from swarmwire.world.backends import allocation as assignments
from swarmwire.world.backends.join_policy import JoinPolicy, ListenSettings
from swarmwire.world.backends.lockstep import Lockstep
from swarmwire.world.backends.pacing import Pace
from swarmwire.world.backends.realtime import RealTime
from swarmwire.world.backends.realtime_backend import PacedBackend, RealTimeBackend
from swarmwire.world.backends.runner_reports import Loss, RunnerEvent
from swarmwire.world.backends.zenoh_backend import BackendHooks, LockstepBackend
from swarmwire.world.gateways.backend import GatewayBackend
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.subtick import Subticks

ANSWER_WITHIN = 0.8  # of a tick of real time, after which a host answers without its late processes
KEPT = ("wait", "stand", "coast")  # answers to a lost runner after which another may take over


@dataclass(frozen=True)
class Backends:
    """How a run's backend is made. `agents` names, by group, the spec of the agent."""

    scenario: Scenario
    static: Static
    agents: Mapping[str, str]
    runners: int  # 0: all agents in this process
    isolation: Isolation  # of the processes
    run_id: str
    clock: Clock
    pace: Pace | None  # of real time; None: as fast as the machine allows
    stopped: Callable[[], bool]  # whether waiting for runners is to end
    listening: Listening | None  # for runners that others start, if it does
    lost: Callable[[Loss], None]  # called with each runner that is lost while the run goes on
    changed: Callable[[RunnerEvent], None]  # called with each runner that joins, leaves, is lost or returns
    say: Callable[[str], None]  # prints and logs a message
    subticks: Subticks | None = None  # of real time, in which packets cross also between ticks

    @contextmanager
    def backend(self, served: Served | None = None) -> Generator[AgentBackend]:
        """The backend, ended with the context; it runs no served robot, but passes on programs' commands."""
        whole = assignments.full_assignment(self.scenario, self.static, dict(self.agents))
        if served and self.pace:
            names = {group.name for group in served.groups}
            others = replace(whole, groups=tuple(group for group in whole.groups if group.name not in names))
            with closing(LocalBackend(others)) as local:
                yield GatewayBackend(
                    local,
                    served.groups,
                    served.medium,
                    self.pace,
                    served.show,
                    served.show_counts,
                    self.subticks,
                )
            return
        if self.listening is not None:
            hooks = self._listening_hooks(self.listening)
            backend = self._remote(self.listening.for_agents(self.run_id), whole, hooks)
            with closing(backend):
                backend.open()
                yield backend
            return
        if not self.runners:
            with closing(LocalBackend(whole)) as local:
                yield PacedBackend(local, self.pace, self.subticks) if self.pace else local
            return
        processes: list[RunnerProcesses] = []

        def trouble() -> str | None:
            return processes[0].trouble() if processes else None

        with local_endpoint() as endpoint:
            around = BackendHooks(
                trouble,
                self.stopped,
                lambda loss: self._survive(loss, endpoint),
                lambda change, _: self._changed(change),
                self._refused,
                waiting=lambda free: self.say(f"{_waiting(free)}, such as: {self._takeover(endpoint)}"),
            )
            backend = self._remote(endpoint, whole, around)
            try:
                backend.open()
                specs = sorted(set(self.agents.values()))
                processes.append(
                    RunnerProcesses(
                        endpoint,
                        self.run_id,
                        specs,
                        self.runners,
                        waited_for=self.pace is None,
                        isolation=self.isolation,
                    )
                )
                yield backend
            finally:
                backend.close()
                for process in processes:
                    process.stop()

    def _listening_hooks(self, listening: Listening) -> BackendHooks:
        """The callbacks of the backend of a world that listens."""
        observer = listening.observer

        def changed(event: RunnerEvent, free: tuple[str, ...]) -> None:
            self.changed(event)
            self.say(str(event))
            observer.changed(event, free)

        def refused(runner: str, why: str) -> None:
            self._refused(runner, why)
            observer.refused(runner, why)

        def opened(endpoints: tuple[str, ...]) -> None:
            observer.opened(endpoints, self.run_id)

        def waiting(free: tuple[str, ...]) -> None:
            self.say(_waiting(free))
            observer.waiting(free)

        return BackendHooks(lambda: None, self.stopped, self._lost, changed, refused, opened, waiting)

    def _changed(self, change: RunnerEvent) -> None:
        self.changed(change)
        if change.what != "lost":  # which `lost` reports, with a remedy
            self.say(str(change))

    def _refused(self, runner: str, why: str) -> None:
        self.say(f"refused {runner!r}: {why}")

    def _remote(
        self, door: ListenSettings | str, whole: Assignment, around: BackendHooks
    ) -> LockstepBackend | RealTimeBackend:
        table, factor = self.scenario.run, self.pace.factor if self.pace else None
        policy = self._join_policy(factor)
        timeout_s, on_loss = table.runner_timeout_s, table.on_runner_loss
        if self.pace:
            registry = RealTime(
                [whole], table.watchdog_s, timeout_s, on_loss, policy, subtick=self.subticks is not None
            )
            return RealTimeBackend(door, self.run_id, registry, timeout_s, around, self.pace, self.subticks)
        return LockstepBackend(door, self.run_id, Lockstep([whole], on_loss, policy), timeout_s, self.clock, around)

    def _join_policy(self, factor: float | None) -> JoinPolicy:
        """The terms on which runners join, in real time at this factor, or in lockstep."""
        scenario, static, listening = self.scenario, self.static, self.listening
        kinds = {group: load_agent(spec) for group, spec in self.agents.items()}
        memory = {group: layout_of(kind) for group, kind in kinds.items()}
        kept = memory if scenario.run.on_runner_loss in KEPT else None
        timeout_s = scenario.run.runner_timeout_s
        answer_within_s = None if factor is None else ANSWER_WITHIN / (factor * static.rate_hz)
        if listening is None:
            return JoinPolicy(memory=kept, timeout_s=timeout_s, answer_within_s=answer_within_s)
        groups = tuple(
            GroupInfo(
                name=group.name,
                agent=scenario.robots[group.name].agent,
                agent_sha256=agent_sha256(kinds[group.name]),
                robots=(group.stop - group.start) * static.arenas,
                free=(),
            )
            for group in static.groups
        )
        session_info = SessionInfo(
            run=self.run_id,
            scenario=scenario.name,
            scenario_sha256=_sha256(scenario.source),
            swarmwire=version("swarmwire-deploy"),
            rate_hz=static.rate_hz,
            real_time=factor,
            groups=groups,
        )
        return JoinPolicy(session_info, True, listening.start_with, listening.limits, kept, timeout_s, answer_within_s)

    def _lost(self, loss: Loss) -> None:
        self.lost(loss)
        if loss.traceback:
            self.say(loss.traceback.rstrip())

    def _survive(self, loss: Loss, endpoint: str) -> None:
        """Tell people of a runner that was lost, and of what they can do."""
        self._lost(loss)
        if self.scenario.run.on_runner_loss == "dead":
            self.say(f"lost runner {loss}; its robots stand still")
            return
        waits = self.scenario.run.on_runner_loss == "wait" and self.pace is None  # which `waiting` reports
        self.say(
            f"lost runner {loss}" + ("" if waits else f"; another may take over, such as: {self._takeover(endpoint)}")
        )

    def _takeover(self, endpoint: str) -> str:
        """The command that starts another runner."""
        agents = ",".join(sorted(set(self.agents.values())))
        return f"python -m {AGENT_HOST} {endpoint} {self.run_id} {agents} NAME 1"


def _waiting(free: tuple[str, ...]) -> str:
    return f"waiting for a runner of {robots_text(free)}"


def _sha256(source: str) -> str:
    """Of the scenario's file; "" if it was made in Python."""
    path = Path(source)
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""

"""A small run in one process: six robots of two runners, a lossy radio, and every frame that crosses between them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from swarmwire.agent.agent import load_agent
from swarmwire.agent.agent_group import layout_of
from swarmwire.agent.executor import AgentExecutor
from swarmwire.comms.observe.truth import Truth
from swarmwire.comms.robot.packets import NO_TX_STATUSES, ReceivedPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, Readings, SparseTable
from swarmwire.comms.wire import frames as frame_codec
from swarmwire.comms.wire.agent_memory import Layout
from swarmwire.comms.wire.assignment import Assignment, split
from swarmwire.comms.wire.join import JoinRequest
from swarmwire.comms.wire.tick_frames import decode_tick, encode_actions
from swarmwire.deploy.runs.scenario_parts import new_medium
from swarmwire.world.backends.allocation import full_assignment
from swarmwire.world.backends.join_policy import JoinPolicy
from swarmwire.world.backends.lockstep import Lockstep
from swarmwire.world.loop import Loop
from swarmwire.world.scenario_file import scenario_from
from swarmwire.world.world import World
from tests.support.agent.hosts import spec

TICKS = 12
RUNNERS = ("one", "two")
JOIN = JoinRequest().encode()
SCENARIO: dict[str, Any] = {
    "format": 1,
    "name": "small",
    "seed": 1,
    "duration_s": 60.0,
    "time": {"rate_hz": 10},
    "arena": {"size_m": [4.0, 4.0], "boundary": "walls"},
    "robots": {
        "flock": {"body": "epuck", "count": 4, "place": {"how": "disc", "radius_m": 0.6}, "agent": spec("Chatter")},
        "scouts": {"body": "epuck", "count": 2, "place": {"how": "disc", "radius_m": 1.0}, "agent": spec("VectorEcho")},
    },
    "radio": {
        "model": "unit-disk",
        "range_m": 1.5,
        "loss": 0.1,
        "bit_rate_bps": 250_000,
        "max_payload_bytes": 100,
        "measures": {"range": {"noise_m": 0.02}, "bearing": {"noise_rad": 0.05}},
    },
}


class SmallRun:
    """The run, and itself the backend of its loop.

    Attributes:
        parts: the robots of each runner.
        layouts: of the memory of each group's robots.
        readings: of the last tick; `received` and `tx_status` likewise.
        frames: to each runner, tick by tick; `answers`: from it.
        truths: what observers see.
    """

    def __init__(self) -> None:
        scenario = scenario_from(SCENARIO, "small.toml")
        agents = {name: group.agent for name, group in scenario.robots.items()}
        kinds = {name: load_agent(agent) for name, agent in agents.items()}
        self.world = World(scenario, (1,), {name: kind.needs for name, kind in kinds.items()})
        self.loop = Loop(self.world, new_medium(scenario, self.world, None), self, ())
        self.assignment = full_assignment(scenario, self.world.static, agents)
        self.parts: Sequence[Assignment] = split(self.assignment, len(RUNNERS))
        self.layouts: Mapping[str, Layout] = {name: layout_of(kind) for name, kind in kinds.items()}
        self.readings: Readings = {}
        self.received = ReceivedPackets.none()
        self.tx_status: TxStatuses = NO_TX_STATUSES
        self.frames: dict[str, list[bytes]] = {name: [] for name in RUNNERS}
        self.answers: dict[str, list[bytes]] = {name: [] for name in RUNNERS}
        self.truths: list[Truth] = []
        self.replacement: Actions | None = None  # in place of the agents' actions
        self._executors = dict(zip(RUNNERS, map(AgentExecutor, self.parts), strict=True))
        self._roster = joined(Lockstep(list(self.parts), policy=JoinPolicy(memory=self.layouts)))

    def do(self, actions: Actions) -> Truth:
        """A tick with these actions."""
        self.replacement = actions
        return self.loop.step()

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        if self.replacement is not None:
            return self.replacement
        self.readings, self.received, self.tx_status = readings, received, tx_status
        for runner, data in self._roster.open_tick(tick, readings, received, tx_status):
            self.frames[runner].append(data)
            answer = self._answer(runner, data)
            self.answers[runner].append(answer)
            self._roster.answer(runner, answer)
        assert not self._roster.counts()
        return self._roster.pop_actions()

    def counts(self) -> dict[str, int]:
        return {}

    def _answer(self, runner: str, data: bytes) -> bytes:
        executor, frame = self._executors[runner], frame_codec.decode(data)
        own = self.assignment.measures or (), readings_of(self.parts, runner)
        readings, received, tx_status = decode_tick(frame, *own)
        actions = executor.act(frame.tick, readings, received, tx_status)
        return encode_actions(frame.tick, with_all(actions), memory=executor.memory(readings))


@cache
def small_run() -> SmallRun:
    """The run after its first ticks."""
    run = SmallRun()
    run.truths = [run.loop.step() for _ in range(TICKS)]
    return run


def joined(roster: Any, *, ready: bool = True) -> Any:
    """A roster whose runners have joined and, if ready, have built their agents."""
    for name in RUNNERS:
        roster.join(name, JOIN)
        if ready:
            roster.answer(name, frame_codec.encode("ready", -1, {}))
    return roster


def with_all(actions: Actions) -> Actions:
    """The actions with a note, a custom actuator and a custom value."""
    one = actions.rows[:1]
    row = np.zeros(1, np.int64)
    note, number, value = (SparseTable(one, row, np.array([set_])) for set_ in (0.0, 0.5, 1.5))
    return replace(actions, notes=replace(note, names=("searching",)), actuators=number, values=value)


def readings_of(parts: Sequence[Assignment], runner: str) -> set[str]:
    """The groups of a runner's robots."""
    return {group.name for group in parts[RUNNERS.index(runner)].groups}

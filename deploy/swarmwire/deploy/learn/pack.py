"""Packs: arenas whose episodes began together under one setting, in a world that pauses before its robots act.

A pack is an ordinary run: the same world, radio, loop and hash; only its backend gets the actions from outside.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from swarmwire.agent.agent_group import AgentGroup
from swarmwire.agent.executor import AgentExecutor
from swarmwire.agent.policy_io import Float32Array, PolicyLayout
from swarmwire.agent.robots import Robots
from swarmwire.agent.step_context import GroupContext, StepTime
from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.clock import tick_start_ns
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.robot.packets import NO_TX_STATUSES, ReceivedPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, Readings
from swarmwire.comms.wire.agent_memory import GroupMemory
from swarmwire.comms.wire.assignment import Assignment, GroupAssignment
from swarmwire.deploy.learn.setting import Setting
from swarmwire.deploy.runs.scenario_parts import new_medium
from swarmwire.metrics.measures.measure import MeasuredStopConditions, Metrics
from swarmwire.metrics.measures.registry import METRICS
from swarmwire.world.backends.allocation import full_assignment
from swarmwire.world.loop import Loop, TickInputs
from swarmwire.world.world import World


class _Driven(AgentGroup):
    """The robots of a group without an agent: the policy acts in the open context of a tick."""

    def __init__(self, group: GroupAssignment, layout: PolicyLayout) -> None:
        super().__init__(group, layout.io.needs, has_on_receive=False)
        self.layout = layout
        self.context: GroupContext | None = None  # of a tick that has begun, if the group acts in it

    def step(self, context: GroupContext) -> None:
        """Nothing: the policy is outside."""

    def receive(self, context: GroupContext) -> None:
        """As `step`."""

    def retain(self, rows: IntArray) -> None:
        """There is no memory."""

    def memory_columns(self) -> dict[str, AnyArray]:
        """As `retain`."""
        return {}

    def load_columns(self, memory: GroupMemory) -> bool:
        """As `retain`."""
        return False


class PolicyBackend:
    """An AgentBackend that shows what robots see, and has them act as it is asked; other groups run their agents."""

    def __init__(self, assignment: Assignment, layouts: dict[str, PolicyLayout]) -> None:
        self._rate_hz = assignment.rate_hz
        self._groups = {of.name: _Driven(of, layouts[of.name]) for of in assignment.groups if of.name in layouts}
        others = tuple(of for of in assignment.groups if of.name not in layouts)
        self._others = AgentExecutor(replace(assignment, groups=others)) if others else None
        self._actions: Float32Array = np.empty((0, 0), np.float32)

    def show(self, inputs: TickInputs, last: Float32Array) -> Float32Array:
        """Begin a tick; what each robot saw last, (rows, size), with what those that act in the tick see."""
        observation = None
        for name, driven in self._groups.items():
            driven.context = None
            if name not in inputs.readings:
                continue
            readings = inputs.readings[name]
            next_ns = tick_start_ns(inputs.tick + driven.assignment.act_every_ticks, self._rate_hz)
            time = StepTime(inputs.tick, inputs.start_ns, next_ns - inputs.start_ns)
            driven.context = driven.begin(time, readings, inputs.received, inputs.tx_status)
            seen = driven.layout.observe(Robots(driven.context))
            if seen.shape == last.shape:
                return seen
            observation = last.copy() if observation is None else observation
            observation[readings.rows, : seen.shape[1]] = seen
        return last if observation is None else observation

    def take(self, actions: Float32Array) -> None:
        """What the robots do from now on, (rows, numbers)."""
        self._actions = actions

    def start(self) -> None:
        """They are ready."""

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """The actions of the robots in the tick that was shown last."""
        parts: list[Actions] = []
        for driven in self._groups.values():
            context = driven.context
            if context is not None:
                rows = context.readings.rows
                mine = self._actions if len(rows) == len(self._actions) else self._actions[rows]
                driven.layout.act(Robots(context), mine[:, : len(driven.layout.action)])
                parts.append(driven.end(context))
                driven.context = None
        if self._others:
            left = {name: group for name, group in readings.items() if name not in self._groups}
            parts.append(self._others.act(tick, left, received, tx_status))
        return Actions.joined(parts)

    def counts(self) -> dict[str, int]:
        """No faults."""
        return {}

    def close(self) -> None:
        """Nothing to end."""


class Pack:
    """Arenas with episodes of one age; arenas leave when their episode is over.

    Attributes:
        slots: (arenas,) the place in the environment of each arena that has not left, in the order of `arenas`.
        arenas: (arenas,) their indices in this pack's world.
        observation: (rows, size) what each robot of this world saw last; 0 for the dead. Replaced, never written to.
        pose_before: (rows, 3) poses at the start of the last tick.
        contacts: (arenas of the world, 2) that began in the last step.
    """

    def __init__(self, setting: Setting, seeds: Sequence[int], slots: IntArray, size: int) -> None:
        """Begin an episode with each of these seeds; `size` is the length of an observation."""
        self._arguments = setting, seeds, slots, size
        self._history: list[AnyArray] = []  # actions of each step, and arenas of each `leave`, a mask
        self.setting, self.slots, self.arenas = setting, slots, np.arange(len(slots))
        scenario = setting.scenario
        self.world = World(scenario, seeds, setting.needs)
        static = self.world.static
        known = set(METRICS.values())  # metrics of users may read the graph without a word
        graph = any("graph" in metric.needs or type(metric) not in known for metric in setting.metrics)
        medium = new_medium(scenario, self.world, setting.traces, graph=graph)
        self._backend = PolicyBackend(full_assignment(scenario, static, setting.agents), setting.layouts)
        self._metrics = Metrics(setting.metrics)
        self._stops = MeasuredStopConditions(self._metrics, setting.conditions) if setting.conditions else None
        observers: list[Observer] = [self._metrics] if setting.metrics else []
        observers += [self._stops] if self._stops else []
        for observer in observers:
            observer.begin(static)
        self._loop = Loop(self.world, medium, self._backend, observers, scenario.events, hashes=setting.hashes)
        self.pose_before, self.contacts = self.world.pose, np.zeros((static.arenas, 2), np.int64)
        # The metrics' values before the last step.
        self._counted: FloatArray = np.zeros((len(setting.metrics), static.arenas))
        self.observation: Float32Array = np.zeros((static.arenas * static.robots, size), np.float32)
        self._begin()

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy runs its episodes again up to here, bit for bit: the state of physics engines cannot be copied."""
        return _replayed, (self._arguments, self._history)

    @property
    def tick(self) -> int:
        """Ticks since the start of its episodes."""
        return self._loop.ticks_done

    def step(self, actions: Float32Array) -> None:
        """Act, and run to the next tick in which the policy acts, or to the end; `actions` is (rows, numbers)."""
        self._history.append(actions.copy())
        self._backend.take(actions)
        period, ticks = self.setting.period, self.setting.ticks
        self._counted = self._metrics.values if self.setting.metrics else self._counted
        contacts = np.zeros((self.world.static.arenas, 2), np.int64)
        for _ in range(period):
            truth = self._loop.end_tick(self._inputs)
            contacts += truth.contact_onsets
            self.pose_before = truth.pose
            self._begin()
            if self.tick == ticks:
                break
        self.contacts = contacts

    def leave(self, over: BoolArray) -> None:
        """Take these arenas out, a mask of `arenas`; others remain."""
        self._history.append(over)
        done = np.zeros(self.world.static.arenas, np.bool_)
        done[self.arenas[over]] = True
        self._loop.leave(done)
        self.slots, self.arenas = self.slots[~over], self.arenas[~over]
        self._inputs = self._inputs.select_arenas(self.world.running, self.world.static.robots)
        self._show()

    def stopped(self) -> BoolArray:
        """The arenas in which a condition has come to hold, (arenas,)."""
        done = self._stops.done() if self._stops else None
        return np.zeros(len(self.arenas), np.bool_) if done is None else done[self.arenas]

    def measured(self) -> FloatArray:
        """The value of each metric, (metrics, arenas): of a level in the last tick, of a count what the step added."""
        now = self._metrics.values
        is_count = np.array([metric.kind == "count" for metric in self._metrics.metrics])[:, None]
        return np.where(is_count, now - np.nan_to_num(self._counted), now)[:, self.arenas]

    def hexdigests(self) -> list[str]:
        """`trajectory_sha256` of each arena so far."""
        whole_world = self._loop.hexdigests()
        return [whole_world[arena] for arena in self.arenas.tolist()]

    def _begin(self) -> None:
        self._inputs = self._loop.begin_tick()
        self._show()

    def _show(self) -> None:
        shown, alive = self._backend.show(self._inputs, self.observation), self.world.alive
        self.observation = shown if alive.all() else np.where(alive[:, None], shown, np.float32(0.0))


def _replayed(arguments: tuple[Setting, Sequence[int], IntArray, int], history: Sequence[AnyArray]) -> Pack:
    pack = Pack(*arguments)
    for entry in history:
        if entry.dtype == np.bool_:
            pack.leave(entry)
        else:
            pack.step(entry)
    return pack

"""Packs: arenas whose episodes began together with the same setting, in a world that pauses before its robots act.

A pack is an ordinary run: the same world, radio, loop and hash; its backend gets the actions from the policy.
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


class _PolicyGroup(AgentGroup):
    """A group of robots controlled by the policy, which acts in the open context of a tick."""

    def __init__(self, group: GroupAssignment, layout: PolicyLayout) -> None:
        super().__init__(group, layout.io.needs, has_on_receive=False)
        self.layout = layout
        self.context: GroupContext | None = None  # context of the current tick, if the group acts in it

    def step(self, context: GroupContext) -> None:
        """Do nothing: the policy acts between ticks."""

    def receive(self, context: GroupContext) -> None:
        """Do nothing: the policy acts between ticks."""

    def retain(self, rows: IntArray) -> None:
        """Do nothing: there is no memory."""

    def memory_columns(self) -> dict[str, AnyArray]:
        """Return no columns: there is no memory."""
        return {}

    def load_columns(self, memory: GroupMemory) -> bool:
        """Load nothing: there is no memory."""
        return False


class PolicyBackend:
    """An AgentBackend that returns observations and executes the policy's actions; other groups run their agents."""

    def __init__(self, assignment: Assignment, layouts: dict[str, PolicyLayout]) -> None:
        self._rate_hz = assignment.rate_hz
        self._groups = {
            group.name: _PolicyGroup(group, layouts[group.name]) for group in assignment.groups if group.name in layouts
        }
        others = tuple(group for group in assignment.groups if group.name not in layouts)
        self._others = AgentExecutor(replace(assignment, groups=others)) if others else None
        self._actions: Float32Array = np.empty((0, 0), np.float32)

    def observe(self, inputs: TickInputs, last: Float32Array) -> Float32Array:
        """Begin a tick; return the last observations (rows, size), updated for robots that act in the tick."""
        observation = None
        for name, group in self._groups.items():
            group.context = None
            if name not in inputs.readings:
                continue
            readings = inputs.readings[name]
            next_ns = tick_start_ns(inputs.tick + group.assignment.act_every_ticks, self._rate_hz)
            time = StepTime(inputs.tick, inputs.start_ns, next_ns - inputs.start_ns)
            group.context = group.begin(time, readings, inputs.received, inputs.tx_status)
            current = group.layout.observe(Robots(group.context))
            if current.shape == last.shape:
                return current
            observation = last.copy() if observation is None else observation
            observation[readings.rows, : current.shape[1]] = current
        return last if observation is None else observation

    def set_actions(self, actions: Float32Array) -> None:
        """Set the actions of the robots from now on, (rows, numbers)."""
        self._actions = actions

    def start(self) -> None:
        """Do nothing: groups need no start."""

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """Return the actions of the robots in the tick of the last observation."""
        parts: list[Actions] = []
        for group in self._groups.values():
            context = group.context
            if context is not None:
                rows = context.readings.rows
                actions = self._actions if len(rows) == len(self._actions) else self._actions[rows]
                group.layout.act(Robots(context), actions[:, : len(group.layout.action)])
                parts.append(group.end(context))
                group.context = None
        if self._others:
            other_readings = {name: part for name, part in readings.items() if name not in self._groups}
            parts.append(self._others.act(tick, other_readings, received, tx_status))
        return Actions.joined(parts)

    def counts(self) -> dict[str, int]:
        """Return no faults."""
        return {}

    def close(self) -> None:
        """Do nothing: groups need no end."""


class Pack:
    """Arenas whose episodes have the same age; arenas leave when their episode is over.

    Attributes:
        slots: (arenas,) indices in the environment of the arenas that have not left.
        arenas: (arenas,) their indices in this pack's world.
        observation: (rows, size) last observation of each robot of this world; 0 for dead robots. A new array per step.
        pose_before: (rows, 3) poses at the start of the last tick.
        contacts: (arenas of the world, 2) new contacts in the last step.
    """

    def __init__(self, setting: Setting, seeds: Sequence[int], slots: IntArray, size: int) -> None:
        """Begin an episode with each of these seeds; `size` is the length of an observation."""
        self._arguments = setting, seeds, slots, size
        self._history: list[AnyArray] = []  # actions of each step, and masks of each `leave`
        self.setting, self.slots, self.arenas = setting, slots, np.arange(len(slots))
        scenario = setting.scenario
        self.world = World(scenario, seeds, setting.needs)
        static = self.world.static
        built_in = set(METRICS.values())  # custom metrics may read the graph without declaring it
        graph = any("graph" in metric.needs or type(metric) not in built_in for metric in setting.metrics)
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
        # Values of metrics before the last step.
        self._counted: FloatArray = np.zeros((len(setting.metrics), static.arenas))
        self.observation: Float32Array = np.zeros((static.arenas * static.robots, size), np.float32)
        self._begin()

    def __reduce__(self) -> tuple[Any, ...]:
        """Copy by executing the episodes again, bit for bit: the state of physics engines cannot be copied."""
        return _replayed, (self._arguments, self._history)

    @property
    def tick(self) -> int:
        """Ticks since the start of the episodes."""
        return self._loop.ticks_done

    def step(self, actions: Float32Array) -> None:
        """Act, and run to the next tick in which the policy acts, or to the end; `actions` is (rows, numbers)."""
        self._history.append(actions.copy())
        self._backend.set_actions(actions)
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
        """Remove the arenas of this mask of `arenas`."""
        self._history.append(over)
        leaving = np.zeros(self.world.static.arenas, np.bool_)
        leaving[self.arenas[over]] = True
        self._loop.leave(leaving)
        self.slots, self.arenas = self.slots[~over], self.arenas[~over]
        self._inputs = self._inputs.select_arenas(self.world.running, self.world.static.robots)
        self._observe()

    def stopped(self) -> BoolArray:
        """Return True for arenas in which a stop condition holds, (arenas,)."""
        done = self._stops.done() if self._stops else None
        return np.zeros(len(self.arenas), np.bool_) if done is None else done[self.arenas]

    def measured(self) -> FloatArray:
        """Return the metrics (metrics, arenas): levels of the last tick, increases of counts in the step."""
        values = self._metrics.values
        is_count = np.array([metric.kind == "count" for metric in self._metrics.metrics])[:, None]
        return np.where(is_count, values - np.nan_to_num(self._counted), values)[:, self.arenas]

    def hexdigests(self) -> list[str]:
        """Return `trajectory_sha256` of each arena so far."""
        digests = self._loop.hexdigests()
        return [digests[arena] for arena in self.arenas.tolist()]

    def _begin(self) -> None:
        self._inputs = self._loop.begin_tick()
        self._observe()

    def _observe(self) -> None:
        observation, alive = self._backend.observe(self._inputs, self.observation), self.world.alive
        self.observation = observation if alive.all() else np.where(alive[:, None], observation, np.float32(0.0))


def _replayed(arguments: tuple[Setting, Sequence[int], IntArray, int], history: Sequence[AnyArray]) -> Pack:
    pack = Pack(*arguments)
    for entry in history:
        if entry.dtype == np.bool_:
            pack.leave(entry)
        else:
            pack.step(entry)
    return pack

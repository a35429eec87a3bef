"""The world: every arena's bodies and senses, tick by tick. It does no I/O and knows neither agents nor the radio."""

from collections.abc import Mapping, Sequence

import numpy as np

from swarmwire.comms.air.signal.numbers import range_of
from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray, KeyArray
from swarmwire.comms.body import Body
from swarmwire.comms.draws import derive_key
from swarmwire.comms.errors import BadInput
from swarmwire.comms.geometry import obstacle_arrays
from swarmwire.comms.senses import Actions, GroupSenses, Senses
from swarmwire.comms.truth import Group, Static
from swarmwire.world.checks import bodies_of
from swarmwire.world.drive import within_wheels
from swarmwire.world.physics import Physics
from swarmwire.world.placement import place
from swarmwire.world.scenario import Scenario
from swarmwire.world.sensors import SENSORS, Accumulating, Scene, Sensor
from swarmwire.world.snapshot import snapshot
from swarmwire.world.states import States


class World:
    """Arenas side by side, one per seed; robot row r is robot r % robots of arena r // robots.

    Each tick: `sense`, then `move`. The arrays below are replaced in each tick, never written to after.

    Attributes:
        static: what does not change.
        keys: (arenas,) the key of each arena's draws, which depends on its seed alone.
        pose: (rows, 3) x, y in m, heading in rad in (-pi, pi], arena frame.
        velocity: (rows, 3) m/s, m/s, rad/s, arena frame.
        command: (rows, 2) applied, within the wheels' limits: forward m/s, left turn rad/s.
        alive: (rows,).
        states: what each robot is at, as its agent named it.
    """

    def __init__(self, scenario: Scenario, seeds: Sequence[int], needs: Mapping[str, Sequence[str]]) -> None:
        """An arena per seed; `needs` names, by group, the senses to compute (`radio.…` is not the world's affair).

        Raises BadInput if a body lacks a sense, or if something finds no room.
        """
        if not seeds:
            raise BadInput(scenario.source, "seed", "expected at least one seed")
        groups = _groups(scenario, bodies_of(scenario, scenario.source))
        self.keys: KeyArray = np.array([derive_key("arena", seed) for seed in seeds], np.uint64)
        placed = [place(scenario, groups, seed, key) for seed, key in zip(seeds, self.keys, strict=True)]
        obstacles, pose = tuple(p.obstacles for p in placed), np.stack([p.pose for p in placed])
        self.static = Static(
            name=scenario.name,
            seeds=tuple(seeds),
            rate_hz=scenario.time.rate_hz,
            arena_size_m=scenario.arena.size_m,
            walled=scenario.arena.boundary == "walls",
            obstacles=obstacles,
            groups=groups,
            robot_names=scenario.robot_names(),
            range_m=range_of(scenario.radio) if scenario.radio else None,
            lights=tuple(p.lights for p in placed),
        )
        tick_s, steps = 1.0 / scenario.time.rate_hz, scenario.physics.steps
        self._physics = Physics(scenario.arena.size_m, self.static.walled, obstacles, groups, pose, tick_s, steps)
        self._sensors = _sensors(scenario, self._scene(), groups, needs)
        rows = self.static.arenas * self.static.robots
        self.alive: BoolArray = np.ones(rows, np.bool_)
        self.command: FloatArray = np.zeros((rows, 2))
        self.states = States(rows)
        self._clipped = self._not_finite = 0
        self._show()

    def live(self, alive: BoolArray) -> None:
        """These robots (rows,) are alive from now on; the others brake, and resist whatever pushes them."""
        self.states.forget(alive & ~self.alive)  # a robot that is revived starts afresh
        self.alive, self.command = alive.copy(), self.command.copy()
        self.command[~alive] = 0.0
        self._physics.braked = ~alive.reshape(self.static.arenas, self.static.robots)

    def sense(self, tick: int) -> Senses:
        """What the robots alive that act in a tick sense, by group: rows rising, and the fields that are needed."""
        senses: Senses = {}
        for group in self.static.groups:
            if tick % group.act_every_ticks:
                for sensor in self._sensors[group.name]:
                    if isinstance(sensor, Accumulating):
                        sensor.follow(tick)
                continue
            index = np.arange(group.start, group.stop)
            rows = (np.arange(self.static.arenas)[:, None] * self.static.robots + index).ravel()
            fields: dict[str, FloatArray] = {}
            for sensor in self._sensors[group.name]:
                fields.update(sensor.read(tick))
            here = self.alive[rows]
            if not here.all():
                rows, fields = rows[here], {name: values[here] for name, values in fields.items()}
            senses[group.name] = GroupSenses(rows, fields)
        return senses

    def move(self, actions: Actions) -> IntArray:
        """Move by one tick. Robots without a new command keep the last one; one that is not finite is none.

        Returns:
            (arenas, 2) contacts that began: robot with robot, robot with wall or obstacle.
        """
        finite = np.isfinite(actions.linear_mps) & np.isfinite(actions.angular_radps)
        self._not_finite += int(np.count_nonzero(actions.drive & ~finite))
        given = actions.drive & finite & self.alive[actions.rows]
        rows = actions.rows[given]
        linear_mps, angular_radps = actions.linear_mps[given], actions.angular_radps[given]
        index = rows % self.static.robots
        within, clipped = within_wheels(self._physics.motors, index, linear_mps, angular_radps)
        self._clipped += int(np.count_nonzero(clipped))
        self.command = self.command.copy()
        self.command[rows] = within
        self.states.take(actions.notes, self.alive)
        onsets = self._physics.tick(self.command.reshape(self.static.arenas, self.static.robots, 2))
        self._show()
        return onsets

    def counts(self) -> dict[str, int]:
        """Commands since the start that the wheels could not follow, or not finite and so dropped; states too many."""
        states = {"states_over_limit": self.states.dropped} if self.states.dropped else {}
        return {"clipped_commands": self._clipped, "nan_commands": self._not_finite, **states}

    def _show(self) -> None:
        self.pose, self.velocity = snapshot(self._physics.state)

    def _scene(self) -> Scene:
        radius_m = np.concatenate([np.full(g.stop - g.start, g.body.radius_m) for g in self.static.groups])
        obstacles = obstacle_arrays(self.static.obstacles)
        static, physics = self.static, self._physics
        return Scene(
            keys=self.keys,
            size_m=static.arena_size_m,
            walled=static.walled,
            obstacles=obstacles,
            lights=static.lights,
            radius_m=radius_m,
            state=physics.state,
            travel_m=physics.travel_m,
            touched=physics.touched,
        )


def _groups(scenario: Scenario, bodies: Mapping[str, Body]) -> tuple[Group, ...]:
    groups: list[Group] = []
    start = 0
    for name, table in scenario.robots.items():
        groups.append(Group(name, bodies[name], start, start + table.count, table.act_every_ticks))
        start += table.count
    return tuple(groups)


def _sensors(
    scenario: Scenario, scene: Scene, groups: Sequence[Group], needs: Mapping[str, Sequence[str]]
) -> dict[str, list[Sensor]]:
    """The sensors of each group that its agents need."""
    made: dict[str, list[Sensor]] = {group.name: [] for group in groups}
    for group in groups:
        for need in dict.fromkeys(needs.get(group.name, ())):
            if need.startswith("radio."):
                continue
            if need not in group.body.senses:
                has = ", ".join(group.body.senses) or "none"
                expected = f"the agent needs the sense {need!r}; the body {group.body.name} has {has}"
                raise BadInput(scenario.source, f"robots.{group.name}.agent", expected)
            made[group.name].append(SENSORS[need](scene, group, group.body.senses[need]))
    return made

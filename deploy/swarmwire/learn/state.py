"""The state of all arenas of an environment, for rewards and terminations: agents do not see it."""

from dataclasses import dataclass

from swarmwire.agent.policy_io import Float32Array
from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.truth import Light, Obstacle


@dataclass(frozen=True, slots=True, kw_only=True)
class ArenaState:
    """All arenas after a step, before any begins a new episode. Do not write to the arrays.

    Each has a row per arena; `robots` are those of an arena in the order of the scenario. Arenas that wait for a reset
    have 0 everywhere.
    """

    time_s: FloatArray  # (arenas,) since the start of the episode
    pose: FloatArray  # (arenas, robots, 3) x, y in m, heading in rad, arena frame
    pose_before: FloatArray  # (arenas, robots, 3) at the start of the last tick
    velocity: FloatArray  # (arenas, robots, 3) m/s, m/s, rad/s, arena frame
    command: FloatArray  # (arenas, robots, 3) in the last tick, within the drives' limits: forward, turn, to the left
    alive: BoolArray  # (arenas, robots)
    contacts: IntArray  # (arenas, 2) that began in the step: of robots with robots, and with walls or obstacles
    action: Float32Array  # (arenas, robots, numbers) as the policy gave it
    metrics: dict[str, FloatArray]  # (arenas,) each; a level at the start of the last tick, a count over the step
    light_m: FloatArray  # (arenas, lights, 2) where the lights stand; NaN beyond the last of an arena
    lights: tuple[tuple[Light, ...], ...]  # of each arena
    obstacles: tuple[tuple[Obstacle, ...], ...]  # of each arena, at the start
    values: tuple[dict[str, object], ...]  # what each episode drew, by path in the scenario

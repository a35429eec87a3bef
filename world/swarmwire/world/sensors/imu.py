"""The IMU: accelerations and turn rate of a body, with a bias per robot that drifts.

Accelerations are the change of velocity over the tick before, in the frame of the body half way through that tick: a
robot that drives a circle measures v w towards its centre. The turn rate is the change of heading over that tick. The
bias begins as a normal draw per robot and field, and changes by a normal step of drift x sqrt(tick) in each tick.
"""

from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, KeyArray
from swarmwire.comms.base.draws import normal as normals
from swarmwire.comms.base.draws import purpose
from swarmwire.comms.base.draws_compiled import normal
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.base.math import compiled as math_compiled
from swarmwire.comms.robot.sensors.imu import ImuSpec
from swarmwire.world.sensors.sensor import BuiltInSensor

BIAS, DRIFT = purpose("imu bias"), purpose("imu drift")


class ImuArrays(NamedTuple):
    """The memory of a group's IMUs for the kernel, and the arrays of the scene."""

    measured: FloatArray  # (arenas, n, fields) set
    previous: FloatArray  # (arenas, n, 3) heading and velocity in the tick before
    bias: FloatArray  # (arenas, n, fields)
    drift: FloatArray  # (fields,) standard deviation of the bias's step in a tick
    first: int  # robot index of the group's first robot
    keys: KeyArray  # (arenas,)
    running: BoolArray  # (arenas,)
    state: FloatArray  # (arenas, robots, 6)
    tick_s: float


class ImuSensor(BuiltInSensor[ImuSpec]):
    """Sensor `imu`: forward_mps2, left_mps2 and turn_radps (n,), in the body's frame; only errors in tick 0."""

    def start(self) -> None:
        """Draw the biases."""
        scene, group, spec = self.scene, self.group, self.spec
        robots = np.arange(group.start, group.stop)
        spread = np.array([spec.bias_std_mps2, spec.bias_std_mps2, spec.bias_std_radps])
        bias = spread * normals(scene.keys[:, None, None], robots[:, None], 0, np.arange(3), BIAS)
        drift = np.array([spec.drift_mps2, spec.drift_mps2, spec.drift_radps])
        self._imu = ImuArrays(
            np.zeros_like(bias),
            scene.state[:, group.start : group.stop, 2:5].copy(),
            bias,
            drift * np.sqrt(scene.tick_s),
            group.start,
            scene.keys,
            scene.running,
            scene.state,
            scene.tick_s,
        )

    def follow(self, tick: int) -> None:
        """Measure the tick before, and let the bias drift."""
        _measure(self._imu, tick)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """Return the accelerations and turn rate of every robot in the tick before, with its bias."""
        self.follow(tick)
        measured = self._imu.measured
        return measured[:, :, 0].copy(), measured[:, :, 1].copy(), measured[:, :, 2].copy()


@njit()
def _measure(imu: Any, tick: int):
    tick_s = imu.tick_s
    for arena in range(imu.measured.shape[0]):
        if not imu.running[arena]:
            continue
        for i in range(imu.measured.shape[1]):
            previous, state = imu.previous[arena, i], imu.state[arena, imu.first + i]
            measured, bias = imu.measured[arena, i], imu.bias[arena, i]
            heading = 0.5 * (previous[0] + state[2])
            ax, ay = (state[3] - previous[1]) / tick_s, (state[4] - previous[2]) / tick_s
            c, s = math_compiled.cos(heading), math_compiled.sin(heading)
            measured[0] = c * ax + s * ay
            measured[1] = c * ay - s * ax
            measured[2] = (state[2] - previous[0]) / tick_s
            previous[:] = state[2:5]
            for k in range(3):
                if imu.drift[k] > 0.0 and tick > 0:
                    bias[k] += imu.drift[k] * normal(imu.keys[arena], imu.first + i, tick, k, DRIFT)
                measured[k] += bias[k]

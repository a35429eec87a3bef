"""The IMU: accelerations and turn rate of a body, with a bias per robot that drifts.

Accelerations are the change of velocity over the tick before, in the frame of the body half way through that tick: a
robot that drives a circle measures v w towards its centre. The turn rate is the change of heading over that tick. The
bias begins as a normal draw per robot and field, and takes a normal step of drift x sqrt(tick) in each tick.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.draws import normal as normals
from swarmwire.comms.base.draws import purpose
from swarmwire.comms.base.draws_compiled import normal
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.robot.sensors.imu import ImuSpec
from swarmwire.world.sensors.sensor import BuiltInSensor

BIAS, DRIFT = purpose("imu bias"), purpose("imu drift")


class ImuSensor(BuiltInSensor[ImuSpec]):
    """Sensor `imu`: forward_mps2, left_mps2 and turn_radps (n,), in the body's frame; 0 but for errors in tick 0."""

    def start(self) -> None:
        """Draw the biases."""
        scene, group, spec = self.scene, self.group, self.spec
        robots = np.arange(group.start, group.stop)
        spread = np.array([spec.bias_std_mps2, spec.bias_std_mps2, spec.bias_std_radps])
        drawn = normals(scene.keys[:, None, None], robots[:, None], 0, np.arange(3), BIAS)
        self._bias = spread * drawn  # (arenas, n, fields)
        drift = np.array([spec.drift_mps2, spec.drift_mps2, spec.drift_radps])
        self._drift = drift * np.sqrt(scene.tick_s)  # (fields,) in a tick
        self._before = scene.state[:, group.start : group.stop, 2:5].copy()  # heading and velocity
        self._felt = np.zeros_like(self._bias)

    def follow(self, tick: int) -> None:
        """Feel the tick before, and let the bias drift."""
        scene, start = self.scene, self.group.start
        of, arenas = (self._felt, self._before, self._bias, self._drift), (scene.keys, scene.running)
        _feel(*of, scene.state, start, *arenas, tick, scene.tick_s)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """What every robot felt in the tick before, with its bias."""
        self.follow(tick)
        felt = self._felt
        return felt[:, :, 0].copy(), felt[:, :, 1].copy(), felt[:, :, 2].copy()


@njit()
def _feel(felt, before, bias, drift, state, start, keys, running, tick, tick_s):
    for arena in range(felt.shape[0]):
        if not running[arena]:
            continue
        for i in range(felt.shape[1]):
            was, now = before[arena, i], state[arena, start + i]
            half_way = 0.5 * (was[0] + now[2])
            ax, ay = (now[3] - was[1]) / tick_s, (now[4] - was[2]) / tick_s
            c, s = np.cos(half_way), np.sin(half_way)
            felt[arena, i, 0] = c * ax + s * ay
            felt[arena, i, 1] = c * ay - s * ax
            felt[arena, i, 2] = (now[2] - was[0]) / tick_s
            was[:] = now[2:5]
            for k in range(3):
                if drift[k] > 0.0 and tick > 0:
                    bias[arena, i, k] += drift[k] * normal(keys[arena], start + i, tick, k, DRIFT)
                felt[arena, i, k] += bias[arena, i, k]

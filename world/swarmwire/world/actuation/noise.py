"""Wheels that do not run as they are asked to, as in ARGoS: at f (w + b) in place of w. Compiled.

The bias b is drawn once for each wheel, the factor f for each wheel and tick.
"""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Sequence

import numpy as np
from numba import njit

from swarmwire.comms import draws
from swarmwire.comms.arrays import FloatArray, KeyArray
from swarmwire.comms.bodies.drives import NO_WHEEL_NOISE, Drive, Holonomic, WheelNoise, wheel_base_of
from swarmwire.comms.draws_compiled import normal
from swarmwire.comms.truth import Group

BIAS, FACTOR = draws.purpose("wheel bias"), draws.purpose("wheel factor")
WHEELS = np.arange(2)  # left and right


class NoisyWheels:
    """The noise of all wheels of all arenas; `any` tells whether there is some."""

    def __init__(self, groups: Sequence[Group], keys: KeyArray) -> None:
        """The biases are drawn now; `keys` (arenas,)."""
        sizes = [group.stop - group.start for group in groups]
        noise = [noise_of(group.body.drive) for group in groups]
        self._keys = keys
        self._noisy = np.repeat([of != NO_WHEEL_NOISE for of in noise], sizes)
        self._wheel_base_m = np.repeat([wheel_base_of(group.body.drive) for group in groups], sizes)
        self._factor = np.repeat([of.factor for of in noise], sizes)
        self._factor_std = np.repeat([of.factor_std for of in noise], sizes)
        mean, spread = np.repeat([(of.bias_mps, of.bias_std_mps) for of in noise], sizes, axis=0).T[:, :, None]
        index = np.arange(len(mean))
        self._bias_mps = mean + spread * draws.normal(keys[:, None, None], index[:, None], 0, WHEELS, BIAS)
        self.any = bool(self._noisy.any())

    def act(self, tick: int, target: FloatArray) -> None:
        """Change what engines are given in a tick, (arenas, robots, 3), to what the wheels make of it."""
        spread = self._wheel_base_m, self._factor, self._factor_std, self._bias_mps
        _act(self._keys, self._noisy, *spread, tick, target)


def noise_of(drive: Drive) -> WheelNoise:
    """The noise of a drive's wheels; none if it has no wheels."""
    return NO_WHEEL_NOISE if isinstance(drive, Holonomic) else drive.noise


@njit(cache=True)
def _act(keys, noisy, wheel_base_m, factor, factor_std, bias_mps, tick, target):
    for arena in range(target.shape[0]):
        for i in range(target.shape[1]):
            forward, turn = target[arena, i, 0], target[arena, i, 1]
            if not noisy[i] or (forward == 0.0 and turn == 0.0):
                continue
            half = 0.5 * wheel_base_m[i] * turn
            left = _factor(keys[arena], i, tick, 0, factor, factor_std) * (forward - half + bias_mps[arena, i, 0])
            right = _factor(keys[arena], i, tick, 1, factor, factor_std) * (forward + half + bias_mps[arena, i, 1])
            target[arena, i, 0] = 0.5 * (left + right)
            target[arena, i, 1] = (right - left) / wheel_base_m[i]


@njit(cache=True)
def _factor(key, i, tick, wheel, factor, factor_std):
    """By what a wheel's speed is multiplied in a tick."""
    if factor_std[i] == 0.0:
        return factor[i]
    return factor[i] + factor_std[i] * normal(key, i, tick, wheel, FACTOR)

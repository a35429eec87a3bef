"""Motors and wheels that failed: motors brake, a wheel stands still while the other goes on. Compiled."""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Mapping, Sequence

import numpy as np
from numba import njit

from swarmwire.comms.arrays import BoolArray, FloatArray
from swarmwire.comms.bodies.body import MOTORS, WHEELS
from swarmwire.comms.bodies.drives import wheel_base_of
from swarmwire.comms.truth import Group


class FailedDrives:
    """The motors and wheels of all arenas that do not work.

    Attributes:
        motors: (arenas, robots) whose motors failed.
        any: whether any motor or wheel failed.
    """

    def __init__(self, groups: Sequence[Group], arenas: int) -> None:
        """All of them work."""
        sizes = [group.stop - group.start for group in groups]
        self._wheel_base_m = np.repeat([wheel_base_of(group.body.drive) for group in groups], sizes)
        self._shape = arenas, sum(sizes)
        self.fail({})

    def fail(self, failed: Mapping[str, BoolArray]) -> None:
        """From now on these parts do not work, by name (rows,), and all others do."""
        none = np.zeros(self._shape, np.bool_)
        masks = [failed[part].reshape(self._shape) if part in failed else none for part in (MOTORS, *WHEELS)]
        self.motors: BoolArray = masks[0]
        self._left, self._right = masks[1], masks[2]
        self.any = any(bool(mask.any()) for mask in masks)

    def act(self, target: FloatArray) -> None:
        """Change what engines are given, (arenas, robots, 3), to what is left of it."""
        _act(self.motors, self._left, self._right, self._wheel_base_m, target)


@njit(cache=True)
def _act(motors, left_failed, right_failed, wheel_base_m, target):
    for arena in range(target.shape[0]):
        for i in range(target.shape[1]):
            if motors[arena, i]:
                target[arena, i] = 0.0
            elif left_failed[arena, i] or right_failed[arena, i]:
                forward, half = target[arena, i, 0], 0.5 * wheel_base_m[i] * target[arena, i, 1]
                left = 0.0 if left_failed[arena, i] else forward - half
                right = 0.0 if right_failed[arena, i] else forward + half
                target[arena, i, 0] = 0.5 * (left + right)
                target[arena, i, 1] = (right - left) / wheel_base_m[i]

"""How far a sender is, and in which direction, from two poses that a tracker saw."""

import math

from swarmwire.comms.wire.radio_bridge import Pose


def range_bearing(own: Pose, sender: Pose) -> tuple[float, float]:
    """Distance in m and direction to the sender in the own frame, in (-pi, pi], positive to the left.

    >>> range_bearing(Pose(1.0, 1.0, math.pi / 2), Pose(-1.0, 1.0, 0.0))
    (2.0, 1.5707963267948966)
    """
    dx_m, dy_m = sender.x_m - own.x_m, sender.y_m - own.y_m
    turn_rad = math.remainder(math.atan2(dy_m, dx_m) - own.heading_rad, math.tau)
    return math.hypot(dx_m, dy_m), math.pi if turn_rad <= -math.pi else turn_rad

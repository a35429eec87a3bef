"""How far apart two robots are, as stages see it: the shortest way on a torus."""

# pyright: basic, reportUnknownMemberType=false

from numba import njit

from swarmwire.comms.geometry.obstacles import to_nearest


@njit(cache=True)
def to_sender_m(pose, sender, receiver, wrap_m):
    """The way from receiver to sender, robot rows of `pose` (rows, 3): x and y in m; `wrap_m` is the medium's."""
    dx, dy = pose[sender, 0] - pose[receiver, 0], pose[sender, 1] - pose[receiver, 1]
    return dx + to_nearest(dx, wrap_m[0]), dy + to_nearest(dy, wrap_m[1])

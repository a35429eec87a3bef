"""The ring of a particle swarm: neighbours by index, wherever they are."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from swarmwire.agent.declared import BadParameter, parameters_of
from swarmwire.comms.arrays import BoolArray, IntArray


def ring_neighbours(sender: IntArray, index: IntArray, count: int, width: int) -> BoolArray:
    """Who of the senders (k,) is at most `width` places from the index (k,) of the robot that heard it."""
    apart = np.mod(sender - index, count)
    return np.minimum(apart, count - apart) <= width


def check_ring(kind: type, params: Mapping[str, Any], robots: int) -> None:
    """BadParameter unless count, width and indices of so many robots can be a ring, or there is none.

    One that is not given has the default of the class `kind`.
    """
    declared = parameters_of(kind)
    count, width, index = (
        params.get(name, declared[name].default) for name in ("ring_count", "ring_width", "ring_index")
    )
    if count < 0:
        raise BadParameter("ring_count", f"expected 0 (no ring) or how many robots are on the ring, got {count}")
    if width < 1:
        raise BadParameter("ring_width", f"expected at least 1 neighbour on each side, got {width}")
    for_all = isinstance(index, int) and robots > 1
    if count > 0 and (for_all or not np.all((np.array(index) >= 0) & (np.array(index) < count))):
        expected = f"expected a list with the index in the arena of each robot, 0 to {count - 1}"
        raise BadParameter("ring_index", f"{expected}, got {index}")

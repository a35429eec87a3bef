"""Fields of neighbours that were heard: a vector for each packet, and their mean over the packets of a robot.

The three rules are Reynolds's (Flocks, Herds, and Schools, 1987) as primitives of one formula each. All their vectors
are between 0 and 1 long.
"""

from typing import Any

import numpy as np

from swarmwire.agent.fields.vectors import Vectors, along
from swarmwire.agent.packet import Packets
from swarmwire.comms.arrays import FloatArray


def attraction(range_m: FloatArray, bearing_rad: FloatArray, rest_m: float) -> Vectors:
    """Towards each neighbour farther than `rest_m`, (k,): min((d - rest_m) / rest_m, 1) long, 0 nearer.

    `range_m` and `bearing_rad` (k,) are those of the packets.
    """
    return np.minimum(np.maximum((range_m - rest_m) / rest_m, 0.0), 1.0) * along(bearing_rad)


def repulsion(range_m: FloatArray, bearing_rad: FloatArray, rest_m: float) -> Vectors:
    """Away from each neighbour nearer than `rest_m`, (k,): (rest_m - d) / rest_m long, 0 farther."""
    return np.minimum((range_m - rest_m) / rest_m, 0.0) * along(bearing_rad)


def spacing(range_m: FloatArray, bearing_rad: FloatArray, rest_m: float) -> Vectors:
    """Towards each neighbour farther than `rest_m` and away from each nearer: attraction and repulsion in one, (k,)."""
    return np.minimum((range_m - rest_m) / rest_m, 1.0) * along(bearing_rad)


def alignment(their_heading_rad: FloatArray, own_heading_rad: FloatArray) -> Vectors:
    """Where each neighbour is heading, (k,), of length 1; both headings (k,) by compasses that agree.

    Of packets heard the receiver's own is `heading_rad[heard.row]`.
    """
    return along(their_heading_rad - own_heading_rad)


def mean_heard(heard: Packets[Any], of: Vectors) -> Vectors:
    """The mean of vectors (k,) over the packets that each robot heard, (n,); no length for who heard nothing."""
    packets = np.maximum(heard.count(), 1)
    return Vectors(heard.sum(of.x) / packets, heard.sum(of.y) / packets)

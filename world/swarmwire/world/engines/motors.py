"""What drives the robots of an arena, as arrays for the engines."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.drives import wheel_base_of
from swarmwire.comms.truth import Group


class Motors(NamedTuple):
    """What drives each robot index of an arena, (robots,) each."""

    wheel_base_m: FloatArray  # 0: it has no wheels
    max_force_n: FloatArray
    max_torque_nm: FloatArray
    mass_kg: FloatArray
    inertia_kgm2: FloatArray


def motors_of(groups: Sequence[Group]) -> Motors:
    """The motors of each robot of the groups in order; a body's mass is spread evenly over its disc."""
    drives = [
        (wheel_base_of(d), d.max_force_n, d.max_torque_nm, b.mass_kg, 0.5 * b.mass_kg * b.radius_m**2)
        for b, d in ((group.body, group.body.drive) for group in groups)
    ]
    columns = np.repeat(np.array(drives), [group.stop - group.start for group in groups], axis=0).T
    return Motors(*(np.ascontiguousarray(column) for column in columns))

"""The records of the discs engine: robots and contacts as rows of an array, and the arguments of its kernels.

Rows of robots are those of all arenas: arena x robots per arena + index.
"""

from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray

ROBOT, LEFT, RIGHT, BOTTOM, TOP, CIRCLE, POLYGON = range(7)  # kinds of bodies that a robot may meet
BEFORE, NOW = 1, 2  # bits of touch: in the last tick, in this tick

ROBOT_RECORD = np.dtype(
    [
        # constants
        ("radius_m", np.float64),
        ("bottom_m", np.float64),
        ("per_kg", np.float64),  # 1 / mass
        ("per_kgm2", np.float64),  # 1 / moment of inertia
        ("max_step_mps", np.float64),  # the greatest change of its velocity by its motors in one step
        ("max_step_radps", np.float64),  # the greatest change of its turn rate
        ("half_base_m", np.float64),  # distance of a wheel from the middle
        # motion
        ("driven", np.int64),  # DRIVEN: its target is not zero; less: driven robots push it; 0: neither
        ("unhindered_radps", np.float64),  # the turn rate that its motors gave it in the last step
        ("middle_rad", np.float64),  # its heading in the middle of the step
        ("cos", np.float64),  # cosine and sine of `middle_rad`
        ("sin", np.float64),
        ("shift_x_m", np.float64),  # the shift that removes its overlaps
        ("shift_y_m", np.float64),
        ("listed_x_m", np.float64),  # its position when near bodies were listed
        ("listed_y_m", np.float64),
        ("against_fixed", np.int64),  # bits of touch with anything fixed
    ]
)

CONTACT_RECORD = np.dtype(
    [
        ("row", np.int64),
        ("kind", np.int64),  # kind of the other body: ROBOT, a wall, CIRCLE or POLYGON
        ("other", np.int64),  # the other robot's row, or the number of the circle or polygon
        ("touch", np.int64),  # bits of touch with another robot
        ("nx", np.float64),  # unit vector towards the other body, the normal
        ("ny", np.float64),
        ("gap_m", np.float64),  # negative: an overlap
        ("closing_mps", np.float64),  # the greatest speed that leaves no overlap after the step
        ("normal_kg", np.float64),  # effective mass along the normal
        ("tangent_kg", np.float64),  # effective mass along the tangent
        ("normal_ns", np.float64),  # impulse of the last step along the normal
        ("tangent_ns", np.float64),  # impulse of the last step along the tangent
    ]
)


class MotionParams(NamedTuple):
    """Constants of the steps."""

    dt_s: float  # length of a step
    steps: int  # steps of a tick
    max_radius_m: float
    per_arena: int  # robots of an arena


class DiscBodies(NamedTuple):
    """The robots of all arenas, written in place."""

    robots: AnyArray  # (rows,) ROBOT_RECORD
    state: FloatArray  # (rows, 6) x, y in m, heading in rad, m/s, m/s, rad/s
    travel_m: FloatArray  # (rows, 2) left and right wheel
    touched: FloatArray  # (rows,) 1 for a robot that touched anything in the tick, else 0
    braked: BoolArray  # (rows,) True: the motors only resist


class NearBodies(NamedTuple):
    """Pairs of bodies that may touch before they are listed again."""

    margin_m: float  # the way that a robot may move before
    contacts: AnyArray  # (k,) CONTACT_RECORD
    buffer: IntArray  # (k,) for the indices of contacts that may touch in a step
    contacting: IntArray  # rows with a listed contact, rising
    isolated: IntArray  # moving rows without, rising


class Fixed(NamedTuple):
    """Walls and obstacles of all arenas."""

    half_size_m: tuple[float, float]  # half the extents of an arena
    circle: FloatArray  # (circles, 3 or more) x, y, radius
    side_start: IntArray  # (polygons + 1,) polygon k has the sides side_start[k] to side_start[k + 1] - 1
    side: FloatArray  # (sides, 5) corner x, y; outward normal x, y; offset

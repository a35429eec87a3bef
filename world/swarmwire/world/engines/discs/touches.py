"""Who touches what, and which contacts began: a pair that touches in this tick and did not in the one before. Compiled.

All that is fixed counts as one thing.
"""

# pyright: basic, reportUnknownMemberType=false

from swarmwire.comms.kernels import borrowing
from swarmwire.world.engines.discs.contacts import BEFORE, NOW, TOUCH_M
from swarmwire.world.engines.discs.fixed import ROBOT


@borrowing()
def begin_tick(contacts, robots, touched):
    """What touched in the tick that ends did so before, and nothing has touched yet."""
    for k in range(len(contacts)):
        contacts[k].touch = BEFORE if contacts[k].touch & NOW else 0
    for row in range(len(robots)):
        robots[row].against_fixed = BEFORE if robots[row].against_fixed & NOW else 0
        touched[row] = 0.0


@borrowing()
def note_touches(contacts, met, robots, state, dt_s, touched, per_arena, onsets):
    """Note what touches at the end of a step: it was pushed, or its gap is next to nothing.

    Args:
        contacts: listed, whose bits of touch are set.
        met: places of those that may have met in the step, after their impulses.
        robots: (rows,) whose bits of touching anything fixed are set.
        state: (rows, 6) after the impulses, before the move.
        dt_s: length of the step.
        touched: (rows,) set to 1 for who touched.
        per_arena: robots of an arena.
        onsets: (arenas, 2) added to: robot with robot, robot with something fixed.
    """
    for k in met:
        contact = contacts[k]
        if contact.push_ns <= 0.0 and contact.gap_m + dt_s * _parting_mps(contact, state) > TOUCH_M:
            continue
        arena = contact.row // per_arena
        touched[contact.row] = 1.0
        if contact.kind == ROBOT:
            touched[contact.which] = 1.0
            onsets[arena, 0] += contact.touch == 0
            contact.touch |= NOW
        else:
            onsets[arena, 1] += robots[contact.row].against_fixed == 0
            robots[contact.row].against_fixed |= NOW


@borrowing()
def _parting_mps(contact, state):
    """How fast the gap grows."""
    parting = -(state[contact.row, 3] * contact.nx + state[contact.row, 4] * contact.ny)
    if contact.kind == ROBOT:
        parting += state[contact.which, 3] * contact.nx + state[contact.which, 4] * contact.ny
    return parting

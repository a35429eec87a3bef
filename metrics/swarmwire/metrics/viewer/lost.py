"""The packets of a recording that ended unheard: a line from sender to receiver in the colour of the fate."""

from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.packets import Fate
from swarmwire.comms.truth import ReceptionRecords
from swarmwire.metrics.viewer.colors import FATES, packed
from swarmwire.metrics.viewer.rows import RerunRows

_ALPHA = 110
_LOST_ALPHA = 40  # loss is everywhere, a third of all packets or so: it must not drown the robots, nor the rarer fates
_ORDER = 1.5  # above the links, below the robots

_COLORS = np.zeros(len(Fate), np.uint32)
for _fate, _color in FATES.items():
    _COLORS[_fate] = packed(_color, _LOST_ALPHA if _fate is Fate.LOST else _ALPHA)


def begin_lost(rec: Any) -> None:
    """Log how lines of unheard packets look."""
    import rerun as rr

    look = rr.LineStrips2D.from_fields(radii=rr.Radius.ui_points(0.5), draw_order=_ORDER)
    rec.log("world/lost_packets", look, static=True)


def add_lost(rows: RerunRows, finished: ReceptionRecords, arena: int, position_m: FloatArray) -> None:
    """Add the packets of an arena that ended unheard since the last tick, as lines between its robots' positions.

    position_m (robots, 2) is where they are now, which is not quite where they were when the packet went on air. A
    packet that never did has no receiver, and so no line.
    """
    import rerun as rr

    own = (finished.arena == arena) & (finished.receiver >= 0) & (finished.fate != Fate.RECEIVED)
    ends = np.column_stack([finished.sender[own], finished.receiver[own]])
    strips, colors = position_m[ends].astype(np.float32), _COLORS[finished.fate[own]]
    rows.add("world/lost_packets", rr.LineStrips2D.columns, strips=strips, colors=colors)

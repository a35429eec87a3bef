"""The event queue of the PHY: a binary heap ordered by (time, kind, robot row).

It holds at most one event of each kind for each robot.
"""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import IntArray
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.sentinels import ABSENT

# Kinds, in the order of events at equal times: a frame ends before another starts.
OFF_AIR, CCA_END, TIMER, SEND, SEND_ACK, ENQUEUE = range(6)
KINDS = 6


class EventQueue(NamedTuple):
    """A binary heap with the heap index of each event, so that events can be rescheduled and cancelled.

    Event e has kind e // rows and robot row e % rows.
    """

    at_ns: IntArray  # (KINDS x rows,) time of each scheduled event
    heap: IntArray  # (KINDS x rows,) events, the next one first
    place: IntArray  # (KINDS x rows,) heap index of each event, or ABSENT
    size: IntArray  # (1,)


def event_queue(rows: int) -> EventQueue:
    """Return an empty queue for `rows` robots."""
    events = KINDS * rows
    return EventQueue(
        np.zeros(events, np.int64), np.zeros(events, np.int64), np.full(events, ABSENT), np.zeros(1, np.int64)
    )


@kernel()
def schedule(queue, kind, row, at_ns):
    """Schedule the robot's event of this kind at `at_ns`, in place of its earlier time."""
    event = kind * (len(queue.at_ns) // KINDS) + row
    place = queue.place[event]
    queue.at_ns[event] = at_ns
    if place == ABSENT:
        place = queue.size[0]
        queue.size[0] += 1
        queue.heap[place], queue.place[event] = event, place
    _sink(queue, _rise(queue, place))


@kernel()
def cancel(queue, kind, row):
    """Cancel the robot's event of this kind, if it is scheduled."""
    event = kind * (len(queue.at_ns) // KINDS) + row
    place = queue.place[event]
    if place == ABSENT:
        return
    queue.place[event] = ABSENT
    queue.size[0] -= 1
    last = queue.heap[queue.size[0]]
    if last != event:
        queue.heap[place], queue.place[last] = last, place
        _sink(queue, _rise(queue, place))


@kernel()
def due_ns(queue, kind, row):
    """Time of the robot's event of this kind in ns; -1 if it is not scheduled."""
    event = kind * (len(queue.at_ns) // KINDS) + row
    return queue.at_ns[event] if queue.place[event] != ABSENT else -1


@kernel()
def _earlier(queue, a, b):
    return queue.at_ns[a] < queue.at_ns[b] or (queue.at_ns[a] == queue.at_ns[b] and a < b)


@kernel()
def _rise(queue, place):
    event = queue.heap[place]
    while place > 0:
        above = (place - 1) // 2
        if not _earlier(queue, event, queue.heap[above]):
            break
        queue.heap[place] = queue.heap[above]
        queue.place[queue.heap[place]] = place
        place = above
    queue.heap[place], queue.place[event] = event, place
    return place


@kernel()
def _sink(queue, place):
    event, size = queue.heap[place], queue.size[0]
    while True:
        below = 2 * place + 1
        if below >= size:
            break
        if below + 1 < size and _earlier(queue, queue.heap[below + 1], queue.heap[below]):
            below += 1
        if not _earlier(queue, queue.heap[below], event):
            break
        queue.heap[place] = queue.heap[below]
        queue.place[queue.heap[place]] = place
        place = below
    queue.heap[place], queue.place[event] = event, place

"""The event queue of the PHY: a binary heap ordered by (time, kind, robot row), with one event per kind and robot."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import IntArray
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.sentinels import ABSENT

# Kinds, in the order of events at equal times: frames end before others start.
OFF_AIR, CCA_END, TIMER, SEND, SEND_ACK, ENQUEUE = range(6)
KINDS = 6
NO_EVENT = -1  # kind where no event is due
NOT_SCHEDULED_NS = -1  # time of an event that is not scheduled


class EventQueue(NamedTuple):
    """A binary heap with the heap index of each event, so that events can be rescheduled and cancelled.

    Event e has kind e // rows and robot row e % rows.
    """

    at_ns: IntArray  # (KINDS x rows,) time of each scheduled event
    heap: IntArray  # (KINDS x rows,) events, the next one first
    heap_index: IntArray  # (KINDS x rows,) heap index of each event, or ABSENT
    size: IntArray  # (1,) number of scheduled events


def event_queue(rows: int) -> EventQueue:
    """Return an empty queue for `rows` robots."""
    events = KINDS * rows
    return EventQueue(
        np.zeros(events, np.int64), np.zeros(events, np.int64), np.full(events, ABSENT), np.zeros(1, np.int64)
    )


@kernel()
def schedule(queue, kind, row, at_ns):
    """Schedule the robot's event of this kind at `at_ns`, or move it there."""
    event = kind * (len(queue.at_ns) // KINDS) + row
    i = queue.heap_index[event]
    queue.at_ns[event] = at_ns
    if i == ABSENT:
        i = queue.size[0]
        queue.size[0] += 1
        queue.heap[i], queue.heap_index[event] = event, i
    _sink(queue, _rise(queue, i))


@kernel()
def cancel(queue, kind, row):
    """Cancel the robot's event of this kind, if it is scheduled."""
    event = kind * (len(queue.at_ns) // KINDS) + row
    i = queue.heap_index[event]
    if i == ABSENT:
        return
    queue.heap_index[event] = ABSENT
    queue.size[0] -= 1
    last = queue.heap[queue.size[0]]
    if last != event:
        queue.heap[i], queue.heap_index[last] = last, i
        _sink(queue, _rise(queue, i))


@kernel()
def due_ns(queue, kind, row):
    """Return the time of the robot's event of this kind in ns, or NOT_SCHEDULED_NS."""
    event = kind * (len(queue.at_ns) // KINDS) + row
    return queue.at_ns[event] if queue.heap_index[event] != ABSENT else NOT_SCHEDULED_NS


@kernel()
def _earlier(queue, a, b):
    return queue.at_ns[a] < queue.at_ns[b] or (queue.at_ns[a] == queue.at_ns[b] and a < b)


@kernel()
def _rise(queue, i):
    event = queue.heap[i]
    while i > 0:
        parent = (i - 1) // 2
        if not _earlier(queue, event, queue.heap[parent]):
            break
        queue.heap[i] = queue.heap[parent]
        queue.heap_index[queue.heap[i]] = i
        i = parent
    queue.heap[i], queue.heap_index[event] = event, i
    return i


@kernel()
def _sink(queue, i):
    event, size = queue.heap[i], queue.size[0]
    while True:
        child = 2 * i + 1
        if child >= size:
            break
        if child + 1 < size and _earlier(queue, queue.heap[child + 1], queue.heap[child]):
            child += 1
        if not _earlier(queue, queue.heap[child], event):
            break
        queue.heap[i] = queue.heap[child]
        queue.heap_index[queue.heap[i]] = i
        i = child
    queue.heap[i], queue.heap_index[event] = event, i

"""The contents of runners' frames "ready", "failed", "lost" and "restarted", decoded and checked."""

from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import IntArray
from swarmwire.comms.base.errors import AgentFailed, BadFrame
from swarmwire.comms.base.printable import LINES, printable
from swarmwire.comms.wire import frames
from swarmwire.world.backends.allocation import Allocation
from swarmwire.world.backends.join_policy import MAX_REASON_LETTERS

MAX_PROCESS_LETTERS = 40  # longest name of a host's process
MAX_TRACEBACK = 100_000  # longest traceback, in characters; terminals print it


def agent_failure(frame: frames.Frame, allocation: Allocation) -> AgentFailed:
    """Decode the failure of an agent in a frame "failed" or "lost"."""
    match frame.values:
        case {"robots": str(robots), "traceback": str(traceback)}:
            text = printable(traceback, MAX_TRACEBACK, keep=LINES)
            return AgentFailed(printable(robots, MAX_REASON_LETTERS), text)
        case _:
            return AgentFailed(allocation.assignment.robots_text, "(the runner sent no traceback)")


class HostProcess(NamedTuple):
    """A process of an agent host that was lost or restarted."""

    rows: IntArray  # (n,) its robot rows, ascending
    name: str  # "runner/process"
    reason: str


def host_process(frame: frames.Frame, allocation: Allocation) -> HostProcess:
    """Decode the process in a frame "lost" or "restarted"; BadFrame for a malformed frame."""
    rows = np.unique(frames.checked_array(frame, "rows", "<i8", (None,)))
    process, reason = frame.values.get("process"), frame.values.get("reason")
    if type(process) is not str or type(reason) is not str or not len(rows):
        raise BadFrame("malformed", "expected rows, process and reason")
    if not np.isin(rows, allocation.all_rows).all():
        raise BadFrame("malformed", "rows: expected the runner's own robots")
    name = f"{allocation.runner}/{printable(process, MAX_PROCESS_LETTERS)}"
    return HostProcess(rows, name, printable(reason, MAX_REASON_LETTERS))


def process_count(frame: frames.Frame, allocation: Allocation) -> int:
    """Decode the number of a runner's processes in its frame "ready"; BadFrame if it is impossible."""
    processes = frame.values.get("processes", 1)
    if type(processes) is not int or not 1 <= processes <= len(allocation.all_rows):
        raise BadFrame("malformed", "processes: expected at least one, and at most one for each robot")
    return processes

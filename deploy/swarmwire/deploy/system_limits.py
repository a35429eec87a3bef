"""What a run needs of the system: open files and threads, asked for before it begins.

Where one of these limits is reached in the middle of a run, libraries below end the process, or hang.
"""

import os
import resource
from _thread import LockType, allocate_lock, start_new_thread
from threading import stack_size

from swarmwire.comms.errors import BadInput

OWN_FILES = 100  # of a world, its tables, and who looks on; 40 were counted before anybody looked on
OWN_THREADS = 40  # of a world with runners on two cores, beside those that its libraries have already
THREADS_PER_CORE = 2
THREADS_PER_RUNNER = 4  # three of the runner's process, and less than one here
SMALL_STACK_BYTES = 1 << 18


def need_open_files(runners: int) -> None:
    """Raise the limit of this process to what a world of so many runners needs; BadInput if that is not allowed."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    needed = OWN_FILES + runners  # each has a link
    if soft == resource.RLIM_INFINITY or soft >= needed:
        return
    try:
        resource.setrlimit(resource.RLIMIT_NOFILE, (needed, hard))
    except (ValueError, OSError):
        raise _refused(runners, f"a limit of at least {needed} open files", hard, "ulimit -n") from None


def need_threads(runners: int) -> None:
    """Return if a world of so many runners may have its threads and processes; else BadInput.

    They are limited for a user, a container, the system, and by memory. So they are started, and ended at once.
    """
    needed = OWN_THREADS + THREADS_PER_CORE * (os.cpu_count() or 1) + THREADS_PER_RUNNER * runners
    before, gate, started = stack_size(SMALL_STACK_BYTES), allocate_lock(), 0
    try:
        with gate:
            while started < needed:
                start_new_thread(_wait_for, (gate,))
                started += 1
    except RuntimeError:
        cures = "ulimit -u, or the container's limit of pids"
        raise _refused(runners, f"room for {needed} more threads and processes", started, cures) from None
    finally:
        stack_size(before)


def _wait_for(gate: LockType) -> None:
    with gate:
        pass


def _refused(runners: int, expected: str, got: int, cures: str) -> BadInput:
    return BadInput("this machine", "", f"expected {expected} for {runners} runners, got {got} ({cures})")

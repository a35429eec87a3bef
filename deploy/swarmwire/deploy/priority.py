"""Priority of the loop over other processes, for runs in real time: the robots' programs need the same cores."""

import os
import resource
import signal
import sys
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress

RT_PRIORITY = 1  # of SCHED_RR, the lowest that goes before all processes of normal priority
AWAKE_US = 1_000_000  # of processor time without a sleep, after which the loop gives way


@contextmanager
def before_other_processes(say: Callable[[str], None]) -> Generator[None]:
    """Within the context this thread goes before all processes of normal priority, where the system permits that.

    Nothing that it starts inherits the priority (SCHED_RESET_ON_FORK in sched(7)), and a thread that no longer sleeps
    loses it (RLIMIT_RTTIME in getrlimit(2)), so that a loop without an end does not take a core from all others. A
    process whose priority was set (`nice`, `chrt`) keeps that. In the main thread only, which handles signals.
    """
    may_handle = threading.current_thread() is threading.main_thread()
    if sys.platform != "linux" or not may_handle or not _is_normal():
        yield
        return
    limits, gave_way = resource.getrlimit(resource.RLIMIT_RTTIME), False

    def give_way(*_: object) -> None:
        nonlocal gave_way
        gave_way = True  # said afterwards: the signal may come while something is printed
        _set_normal()

    handler = signal.signal(signal.SIGXCPU, give_way)
    try:
        resource.setrlimit(resource.RLIMIT_RTTIME, (AWAKE_US, limits[1]))
        os.sched_setscheduler(0, os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_param(RT_PRIORITY))
        say(f"real time: the loop goes before other processes (SCHED_RR, priority {RT_PRIORITY})")
    except (OSError, ValueError):
        permit = "sudo prlimit --rtprio=1 --pid $$" if os.geteuid() else "the capability SYS_NICE"
        say(f"real time: other processes may delay the loop; to let it go before them: {permit}")
    try:
        yield
    finally:
        _set_normal()
        resource.setrlimit(resource.RLIMIT_RTTIME, limits)
        signal.signal(signal.SIGXCPU, handler)
        if gave_way:
            awake = f"{AWAKE_US / 1e6:g} s without a sleep"
            say(f"real time: the loop ran for {awake}, and no longer went before other processes from then on")


def _is_normal() -> bool:
    policy = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK
    return policy == os.SCHED_OTHER and os.getpriority(os.PRIO_PROCESS, 0) == 0


def _set_normal() -> None:
    for flag in (0, os.SCHED_RESET_ON_FORK):  # without rights the flag stays, which has no effect at this priority
        with suppress(PermissionError):
            os.sched_setscheduler(0, os.SCHED_OTHER | flag, os.sched_param(0))
            return

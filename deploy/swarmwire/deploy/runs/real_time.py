"""Runs in real time: a rehearsal before the run, and priority of its loop over other processes.

The rehearsal runs some ticks with a copy of the world, so that no kernel is compiled during the run. Otherwise a robot
driven in real time would not react for half a minute, and the run would stay late. The priority helps where robots'
programs and agents need the same cores.
"""

import os
import resource
import signal
import sys
import threading
from collections.abc import Callable, Generator, Iterable
from contextlib import contextmanager, suppress
from dataclasses import replace

import numpy as np

from swarmwire.comms.base.clock import tick_start_ns
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.observe.interfaces import SubtickMedium, SubtickPackets
from swarmwire.comms.observe.truth import Static
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.robot.packets import NO_TX_STATUSES, Payloads, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, Readings
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.measures.metric import Metric
from swarmwire.metrics.measures.network.latency import RadioTally
from swarmwire.world.loop import Loop
from swarmwire.world.world import World

REHEARSAL_TICKS = 5  # enough for the packets of the first tick to be received and to end
SUBTICKS = 20  # sub-ticks of a tick of the rehearsal
PACKET = b"\0"
RT_PRIORITY = 1  # the lowest of SCHED_RR, above all processes of normal priority
AWAKE_US = 1_000_000  # processor time without a sleep after which the loop loses its priority


def warm_up(world: World, medium: RadioMedium | None, metrics: Iterable[Metric], *, subticks: bool = False) -> None:
    """Run a temporary world and medium, in which every robot drives and sends, and measure the metrics.

    With `subticks` packets are also sent and received within ticks.
    """
    observers = [Metrics(tuple(metrics)), RadioTally()]
    for observer in observers:
        observer.begin(world.static)
    backend = _Rehearsal(world.static, sends=medium is not None)
    Loop(world, medium, backend, observers, timed=backend if subticks else None).run(REHEARSAL_TICKS)


class _Rehearsal:
    """A backend in which every robot drives and sends."""

    def __init__(self, static: Static, *, sends: bool) -> None:
        self._rate_hz = static.rate_hz
        rows = np.arange(static.arenas * static.robots)
        still = np.zeros(len(rows))
        packets = SentPackets(rows, np.full(len(rows), BROADCAST), Payloads.from_rows([PACKET] * len(rows)))
        sent = packets if sends else SentPackets.none()
        self._actions = Actions(rows, np.ones(len(rows), np.bool_), still + 0.01, still, still, sent)

    def start(self) -> None:
        """Return at once."""

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """Return the same actions in every tick."""
        return self._actions

    def act_in_time(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses, medium: SubtickMedium
    ) -> Actions:
        """Return the actions of `act` without their packets, of which one is sent in each sub-tick."""
        start_ns, end_ns = (tick_start_ns(number, self._rate_hz) for number in (tick, tick + 1))
        for k in range(min(SUBTICKS, len(self._actions.sent))):
            time_ns = start_ns + (end_ns - start_ns) * k // SUBTICKS
            medium.send(SubtickPackets(time_ns, None, self._actions.sent.select(np.array([k]))))
            medium.advance(time_ns)
        return replace(self._actions, sent=SentPackets.none())

    def counts(self) -> dict[str, int]:
        """Return no faults."""
        return {}

    def close(self) -> None:
        """Do nothing."""


@contextmanager
def raised_priority(report: Callable[[str], None]) -> Generator[None]:
    """Raise this thread's priority above all normal processes within the context, if the system permits that.

    Processes and threads that it starts do not inherit the priority (SCHED_RESET_ON_FORK in sched(7)). A thread that
    no longer sleeps loses it (RLIMIT_RTTIME in getrlimit(2)), so that an endless loop does not block a core. A process
    whose priority was set (`nice`, `chrt`) keeps it. The context has an effect in the main thread only, which handles
    signals.
    """
    may_handle = threading.current_thread() is threading.main_thread()
    if sys.platform != "linux" or not may_handle or not _is_normal():
        yield
        return
    limits, has_lost_priority = resource.getrlimit(resource.RLIMIT_RTTIME), False

    def lose_priority(*_: object) -> None:
        nonlocal has_lost_priority
        has_lost_priority = True  # reported later, since the signal may interrupt a print
        _set_normal()

    handler = signal.signal(signal.SIGXCPU, lose_priority)
    try:
        resource.setrlimit(resource.RLIMIT_RTTIME, (AWAKE_US, limits[1]))
        os.sched_setscheduler(0, os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_param(RT_PRIORITY))
        report(f"real time: the loop goes before other processes (SCHED_RR, priority {RT_PRIORITY})")
    except (OSError, ValueError):
        command = "sudo prlimit --rtprio=1 --pid $$" if os.geteuid() else "the capability SYS_NICE"
        report(f"real time: other processes may delay the loop; to let it go before them: {command}")
    try:
        yield
    finally:
        _set_normal()
        resource.setrlimit(resource.RLIMIT_RTTIME, limits)
        signal.signal(signal.SIGXCPU, handler)
        if has_lost_priority:
            awake = f"{AWAKE_US / 1e6:g} s without a sleep"
            report(f"real time: the loop ran for {awake}, and no longer went before other processes from then on")


def _is_normal() -> bool:
    policy = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK
    return policy == os.SCHED_OTHER and os.getpriority(os.PRIO_PROCESS, 0) == 0


def _set_normal() -> None:
    for flag in (0, os.SCHED_RESET_ON_FORK):  # without rights the flag stays, without effect at this priority
        with suppress(PermissionError):
            os.sched_setscheduler(0, os.SCHED_OTHER | flag, os.sched_param(0))
            return

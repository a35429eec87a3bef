"""Runs in real time: a rehearsal before the run, and priority of its loop over other processes.

The rehearsal is some ticks apart from the run, so that what a machine has not compiled yet is not compiled within it.
Otherwise a robot driven in real time would not react for half a minute, and the run would stay late. The priority is
for robots' programs and agents, which need the same cores.
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

REHEARSAL_TICKS = 5  # by which packets of the first have come, and are over
SUBTICKS = 20  # of a tick of the rehearsal
PACKET = b"\0"
RT_PRIORITY = 1  # of SCHED_RR, the lowest that goes before all processes of normal priority
AWAKE_US = 1_000_000  # of processor time without a sleep, after which the loop gives way


def warm_up(world: World, medium: RadioMedium | None, metrics: Iterable[Metric], *, subticks: bool = False) -> None:
    """Run a temporary world and medium: every robot drives and sends, and metrics are measured.

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
        """They are ready."""

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """The same in every tick."""
        return self._actions

    def act_in_time(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses, medium: SubtickMedium
    ) -> Actions:
        """As `act`; one packet is sent in each sub-tick."""
        start_ns, end_ns = (tick_start_ns(of, self._rate_hz) for of in (tick, tick + 1))
        for k in range(min(SUBTICKS, len(self._actions.sent))):
            at_ns = start_ns + (end_ns - start_ns) * k // SUBTICKS
            medium.send(SubtickPackets(at_ns, None, self._actions.sent.select(np.array([k]))))
            medium.advance(at_ns)
        return replace(self._actions, sent=SentPackets.none())

    def counts(self) -> dict[str, int]:
        """No faults."""
        return {}

    def close(self) -> None:
        """Nothing to end."""


@contextmanager
def raised_priority(say: Callable[[str], None]) -> Generator[None]:
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

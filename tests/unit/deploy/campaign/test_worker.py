"""A task in this process: its rows, and that it ends when nobody waits for it."""

import pytest

from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.errors import Interrupted
from swarmwire.deploy.campaign.worker import ALIVE_S, Alive, Task, run_task
from swarmwire.deploy.controls import Interrupt
from tests.support.clocks import FakeClock


def test_a_run_calls_alive_while_ticks_go_on_but_not_every_tick():
    clock, calls = FakeClock(), []
    alive = Alive(lambda: calls.append(clock.time_ns) or True, interrupt := Interrupt(), clock)
    for _ in range(20):
        alive.see(None)
        clock.time_ns += NS_PER_S // 10
    assert len(calls) == 2
    assert calls[1] - calls[0] == ALIVE_S * NS_PER_S
    assert not interrupt.asked


def test_a_task_that_nobody_waits_for_ends_without_a_row(stumbling):
    with pytest.raises(Interrupted):
        run_task(Task(str(stumbling), ("duration_s=100000",), 0, (0, 1), (1, 2)), alive=lambda: False)

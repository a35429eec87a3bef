"""Compiling: its time is counted apart, is no cost of a tick, and is shown as a state of the run."""

import pytest
from numba.core.event import trigger_event

from swarmwire.comms.base.clock import Clock
from swarmwire.comms.base.kernels import COMPILE_EVENT
from swarmwire.deploy.runs.compiling import CompileTime
from swarmwire.deploy.runs.control_server import Status
from swarmwire.deploy.runs.controls import Controls
from swarmwire.metrics.measures.measure import Metrics
from tests.support.clocks import FakeClock
from tests.support.metrics.truths import static, truth

MS = 1_000_000


def test_compile_time_counts_kernels_within_kernels_once_and_only_while_entered():
    clock = FakeClock()
    with CompileTime(clock) as compiling:
        clock.time_ns += 3 * MS
        with trigger_event(COMPILE_EVENT):
            clock.time_ns += 5 * MS
            with trigger_event(COMPILE_EVENT):
                clock.time_ns += 7 * MS
                assert compiling.total_ns() == 12 * MS
        clock.time_ns += 11 * MS
        assert compiling.total_ns() == 12 * MS
    with trigger_event(COMPILE_EVENT):
        clock.time_ns += 13 * MS
    assert compiling.total_ns() == 12 * MS


def status_of(clock: Clock, compiling: CompileTime) -> Status:
    metrics = Metrics([])
    metrics.begin(static(2))
    names = {"run_id": "r", "scenario": "s", "ticks": 9}
    callbacks = {"health": lambda: None, "counts": dict, "radio": lambda: None, "events": list}
    controls = Controls(clock, 10)
    return Status(metrics=metrics, controls=controls, clock=clock, compiled_ns=compiling.total_ns, **names, **callbacks)


@pytest.mark.parametrize("tick", [0, 1, 2])
def test_status_says_compiling_in_a_tick_that_compiles_and_leaves_it_out_of_the_cost(tick):
    clock, run = FakeClock(), static(2)
    with CompileTime(clock) as compiling:
        status = status_of(clock, compiling)
        status.begin(run)
        status._controls.wait(0, lambda: False)
        for before in range(tick):
            status.began()
            clock.time_ns += 4 * MS
            status.see(truth(run, before))
        status.began()
        assert status.now()["state"] == "running"
        with trigger_event(COMPILE_EVENT):
            clock.time_ns += 90_000 * MS
            assert status.now()["state"] == "compiling"
        clock.time_ns += 4 * MS
        assert status.now()["state"] == "compiling"  # until the tick ends, though no kernel is under way
        status.see(truth(run, tick))
        assert status.now()["state"] == "running"
    assert status.now()["measures_ms"] == (None if tick == 0 else pytest.approx(4.0))

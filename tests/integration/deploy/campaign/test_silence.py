"""A worker that says nothing any more is ended, and its task is lost with it; who was frozen itself counts nothing."""

import psutil

from swarmwire.comms.clock import NS_PER_S
from swarmwire.deploy.campaign import spare_processes, worker_process
from swarmwire.deploy.campaign.execution import execute
from swarmwire.deploy.campaign.local_executor import LocalExecutor
from swarmwire.deploy.campaign.silence import MOST_S, SAY_S, Alive, Silence
from swarmwire.deploy.campaign.spare_processes import SpareProcess
from swarmwire.deploy.campaign.task import Task
from tests.support.clocks import FakeClock

ONCE = """
import os, signal
from pathlib import Path
from swarmwire.agent import Agent
class FrozenOnce(Agent):
    def step(self, robot):
        before = Path(__file__).with_name("before")
        if not before.exists():
            before.touch()
            os.kill(os.getpid(), signal.SIGSTOP)
"""
TASK = Task("x", (), 0, (0,), (1,))


class WhileFrozen(FakeClock):
    """A clock that goes on by a second with each look while a child of this process is frozen."""

    def now_ns(self) -> int:
        if any(child.status() == psutil.STATUS_STOPPED for child in psutil.Process().children()):
            self.time_ns += NS_PER_S
        return self.time_ns


def test_a_worker_that_is_frozen_is_ended_and_its_runs_are_done_by_another(scenario, monkeypatch):
    monkeypatch.setattr(worker_process, "Silence", lambda: Silence(WhileFrozen(), most_s=2.0))
    (scenario.parent / "frozen.py").write_text(ONCE)
    executor, rows, lost = LocalExecutor(1), [], []
    finished = executor.finished
    monkeypatch.setattr(executor, "finished", lambda timeout_s: _noted(finished(timeout_s), lost))
    task = Task(str(scenario), ('robots.pair.agent="frozen.py:FrozenOnce"',), 0, (0,), (1,))
    try:
        assert execute([task], executor, lambda _, result: rows.extend(result.rows))
    finally:
        executor.close()
    assert [row["ended"] for row in rows] == ["duration"]
    assert [done.lost for done in lost] == ["the worker stood still for 2 s", ""]


def _noted(found, into):
    into.extend(found)
    return found


class Mute:
    """A worker process that says nothing, on a clock that goes on by a second with each look."""

    def __init__(self, name, said):
        clock = FakeClock()
        clock.now_ns = lambda: setattr(clock, "time_ns", clock.time_ns + NS_PER_S) or clock.time_ns
        self.silence = Silence(clock, most_s=2.0)
        self.give = self.end = lambda *_: None


def test_a_process_of_a_cluster_that_says_nothing_is_lost(monkeypatch):
    monkeypatch.setattr(spare_processes, "WorkerProcess", Mute)
    assert SpareProcess("x").done(TASK, lambda: True) == {"lost": "the worker stood still for 2 s"}


def test_who_looks_often_counts_the_time_and_who_was_frozen_itself_does_not():
    clock = FakeClock()
    silence = Silence(clock)
    clock.time_ns += 3600 * NS_PER_S  # Ctrl-Z, and fg
    assert not silence.too_long()
    for _ in range(int(MOST_S) - 1):
        clock.time_ns += NS_PER_S
        assert not silence.too_long()
    clock.time_ns += NS_PER_S
    assert silence.too_long()
    silence.broken()
    assert not silence.too_long()


def test_a_run_says_that_it_goes_on_but_not_every_tick():
    clock, said = FakeClock(), []
    alive = Alive(lambda: said.append(clock.time_ns), clock)
    for _ in range(100):
        alive.see(None)
        clock.time_ns += NS_PER_S // 10
    assert len(said) == 2
    assert said[1] - said[0] == SAY_S * NS_PER_S

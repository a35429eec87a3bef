"""A worker that says nothing any more is ended, and its task is lost with it; who was frozen itself counts nothing."""

from swarmwire.comms.clock import NS_PER_S
from swarmwire.deploy.campaign import spare_processes
from swarmwire.deploy.campaign.silence import MAX_S, SAY_S, Alive, Silence
from swarmwire.deploy.campaign.spare_processes import SpareProcess
from swarmwire.deploy.campaign.task import Task
from tests.support.clocks import FakeClock

TASK = Task("x", (), 0, (0,), (1,))


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
    for _ in range(int(MAX_S) - 1):
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

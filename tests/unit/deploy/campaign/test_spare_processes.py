"""Worker processes kept for a campaign: taken again, ended when they died, are not wanted, or nobody takes them."""

from threading import Event
from typing import ClassVar

import pytest

from swarmwire.deploy.campaign import spare_processes
from swarmwire.deploy.campaign.spare_processes import NotWanted, SpareProcesses
from swarmwire.deploy.campaign.task import Task

TASK = Task("x", (), 0, (0,), (1,))


class Process:
    """Stands for one that does what it is told to in `says`."""

    made: ClassVar[list["Process"]] = []
    says: ClassVar[dict[str, str]] = {}

    def __init__(self, name):
        self.ended = Event()
        self.made.append(self)

    def done(self, task, wanted):
        if not wanted():
            raise NotWanted
        return self.says

    def end(self):
        self.ended.set()


@pytest.fixture
def made(monkeypatch):
    monkeypatch.setattr(spare_processes, "SpareProcess", Process)
    monkeypatch.setattr(Process, "made", [])
    return Process.made


def wanted():
    return True


def test_a_process_serves_one_campaign_and_is_taken_again(made):
    spare = SpareProcesses(idle_s=60.0)
    for campaign in ("a", "a", "b", "a"):
        assert spare.done(campaign, "x", TASK, wanted) == {}
    assert len(made) == 2
    assert not any(process.ended.is_set() for process in made)
    for process, timer in [of for each in spare._spare.values() for of in each]:
        timer.cancel()
        assert process in made


def test_a_process_that_nobody_takes_again_ends(made):
    spare = SpareProcesses(idle_s=0.0)
    spare.done("a", "x", TASK, wanted)
    assert made[0].ended.wait(timeout=60.0)
    assert spare._spare == {}
    spare.done("a", "x", TASK, wanted)
    assert len(made) == 2
    assert made[1].ended.wait(timeout=60.0)


def test_a_process_that_died_or_whose_task_is_not_wanted_is_not_kept(made, monkeypatch):
    spare = SpareProcesses()
    with pytest.raises(NotWanted):
        spare.done("a", "x", TASK, lambda: False)
    monkeypatch.setattr(Process, "says", {"lost": "signal 9"})
    assert spare.done("a", "x", TASK, wanted) == {"lost": "signal 9"}
    assert [process.ended.is_set() for process in made] == [True, True]
    assert spare._spare == {}

"""How the processes of runners share the cores of their machine."""

import os
import socket

import psutil
import pytest

from swarmwire.comms.interfaces import Observer
from swarmwire.comms.truth import Truth
from swarmwire.deploy import run
from tests.integration.examples.test_examples import EXAMPLES
from tests.support.deploy.commands import LOSSY

SHORT = ["duration_s=0.5", "robots.flock.count=3"]


class Policies(Observer):
    """Observer that asks how the system schedules each runner."""

    def __init__(self) -> None:
        self.found = list[int]()

    def see(self, truth: Truth) -> None:
        """Ask, in every tick."""
        agent_host = [child for child in psutil.Process().children() if "swarmwire.agent.agent_host" in child.cmdline()]
        self.found = [os.sched_getscheduler(runner.pid) for process in agent_host for runner in process.children()]


@pytest.mark.skipif(not hasattr(os, "SCHED_BATCH"), reason="the system has no scheduling in batches")
@pytest.mark.parametrize(("realtime", "policy"), [(None, "SCHED_BATCH"), (2.0, "SCHED_OTHER")])
def test_runners_take_turns_in_lockstep_and_start_at_once_in_real_time(realtime: float | None, policy: str) -> None:
    policies = Policies()
    run(EXAMPLES / "protocol" / "flock.toml", overrides=SHORT, runners=2, realtime=realtime, observers=[policies])
    assert policies.found == [getattr(os, policy)] * 2


def test_a_socket_that_a_run_left_behind_is_taken_over(tmp_path):
    stale = tmp_path / "s"
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(str(stale))
    assert run(LOSSY, overrides=["duration_s=0.5"], runners=1, socket=stale).ticks == 5

"""The priority of the loop over other processes, in runs in real time."""

import os
import resource
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Truth
from swarmwire.deploy import run
from swarmwire.deploy.runs.real_time import AWAKE_US, raised_priority
from tests.support.deploy.runs import LOSSY

RAISED = os.SCHED_RR | os.SCHED_RESET_ON_FORK
SHOW = "import os; print(os.sched_getscheduler(0))"


def may_be_raised() -> bool:
    """Whether this process may have a real-time priority."""
    lines: list[str] = []
    with raised_priority(lines.append):
        return os.sched_getscheduler(0) == RAISED


needs_priority = pytest.mark.skipif(not may_be_raised(), reason="this process may not have a real-time priority")


class Policies(Observer):
    """Observer that asks how the system schedules the loop, and a process that the loop starts."""

    def __init__(self) -> None:
        self.of_loop, self.of_child = list[int](), list[int]()

    def see(self, truth: Truth) -> None:
        """Ask, in every tick."""
        self.of_loop.append(os.sched_getscheduler(0))
        child = subprocess.run([sys.executable, "-I", "-S", "-c", SHOW], capture_output=True, check=True)
        self.of_child.append(int(child.stdout))


class Endless(Observer):
    """Observer that does not end before its thread has lost its priority."""

    def see(self, truth: Truth) -> None:
        """Run without a sleep."""
        while os.sched_getscheduler(0) != os.SCHED_OTHER:
            pass


def policies_of(**options: float | None) -> Policies:
    """Those of a short run."""
    policies = Policies()
    run(LOSSY, overrides=["duration_s=0.2"], observers=[policies], **options)
    return policies


@needs_priority
def test_loop_goes_before_other_processes_in_real_time_and_children_do_not():
    before = os.sched_getscheduler(0), resource.getrlimit(resource.RLIMIT_RTTIME), signal.getsignal(signal.SIGXCPU)
    policies = policies_of(realtime=1.0)
    assert set(policies.of_loop) == {RAISED}
    assert set(policies.of_child) == {os.SCHED_OTHER}
    after = os.sched_getscheduler(0), resource.getrlimit(resource.RLIMIT_RTTIME), signal.getsignal(signal.SIGXCPU)
    assert after == before


def test_loop_has_no_priority_in_lockstep():
    assert set(policies_of().of_loop) == {os.sched_getscheduler(0)}


@needs_priority
def test_loop_that_does_not_sleep_gives_up_its_priority(capsys: pytest.CaptureFixture[str]):
    run(LOSSY, overrides=["duration_s=0.2"], realtime=1.0, subtick=0.001, observers=[Endless()])
    errors = capsys.readouterr().err
    assert "real time: the loop goes before other processes (SCHED_RR, priority 1)" in errors
    assert f"real time: the loop ran for {AWAKE_US / 1e6:g} s without a sleep, and no longer went" in errors


@pytest.mark.parametrize(
    ("user", "permit"), [(0, "the capability SYS_NICE"), (1000, "sudo prlimit --rtprio=1 --pid $$")]
)
def test_priority_that_is_not_permitted_prints_what_would_permit_it(
    monkeypatch: pytest.MonkeyPatch, user: int, permit: str
):
    def refuse(*_: object) -> None:
        raise PermissionError

    lines: list[str] = []
    with monkeypatch.context() as refusing:
        refusing.setattr(os, "sched_setscheduler", refuse)
        refusing.setattr(os, "geteuid", lambda: user)
        refusing.setattr(os, "getpriority", lambda *_: 0)  # also of tests that are nice
        with raised_priority(lines.append):
            pass
    assert lines == [f"real time: other processes may delay the loop; to let it go before them: {permit}"]


def test_process_that_is_nice_gets_no_priority(tmp_path: Path):
    program = f"from swarmwire.deploy.runs.real_time import raised_priority\nwith raised_priority(print):\n    {SHOW}\n"
    nice = ["nice", "-n", "1", sys.executable, "-c", program]
    done = subprocess.run(nice, capture_output=True, text=True, check=True, cwd=tmp_path)
    assert done.stdout == f"{os.SCHED_OTHER}\n"

"""However a run ends, it says so, and nothing of it is left behind."""

import json
import os
import signal
from pathlib import Path

import psutil
import pytest
import typer

from swarmwire.comms.errors import Interrupted
from swarmwire.deploy.commands.hang_up import leaving_when_hung_up
from swarmwire.deploy.interrupt import Interrupt
from swarmwire.metrics.verify.verify import verify
from tests.support.deploy.commands import LOSSY, family, runners_of, started, swarmwire

LONG = ["--set", "duration_s=3600", "--runners", "4", "--set", "robots.flock.count=8"]
GONE_S = 20.0  # of a machine that is busy: they are gone in a fraction of a second


@pytest.fixture
def long_run(tmp_path):
    process = started(LOSSY, *LONG, "--out", tmp_path / "run")
    children = family(process)
    assert len(children) == 5  # a nursery and four runners
    yield process, children
    for left in [*children, psutil.Process(process.pid)] if process.poll() is None else children:
        if left.is_running():
            left.kill()
    process.communicate()


def test_killing_the_world_leaves_no_process_and_no_socket(long_run):
    process, children = long_run
    endpoint = next(word for word in children[0].cmdline() if word.startswith("unixsock-stream/"))
    directory = Path(endpoint.partition("/")[2]).parent
    assert directory.is_dir()
    process.kill()
    _, alive = psutil.wait_procs(children, timeout=GONE_S)
    assert not alive
    assert not directory.exists()


def test_killing_a_runner_ends_the_run_and_names_its_robots(long_run):
    process, children = long_run
    runners_of(process)[2].kill()
    _, errors = process.communicate(timeout=GONE_S + 5)
    assert process.returncode == 1
    assert "flock-" in errors
    assert "was lost" in errors
    assert "Traceback" not in errors
    _, alive = psutil.wait_procs(children, timeout=GONE_S)
    assert not alive


def test_killing_the_nursery_and_all_runners_ends_the_run(long_run):
    process, children = long_run
    os.killpg(children[0].pid, signal.SIGKILL)
    _, errors = process.communicate(timeout=GONE_S + 5)
    assert process.returncode == 1
    assert "was lost" in errors


def test_an_interrupt_ends_the_run_with_a_summary(long_run, tmp_path):
    process, children = long_run
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=GONE_S + 5)
    assert (process.returncode, errors) == (130, "")
    assert "interrupted" in output
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["ended"] == "interrupted"
    assert summary["ticks"] < 36_000
    assert sum(summary["radio"]["fates"].values()) == summary["radio"]["intended"]
    _, alive = psutil.wait_procs(children, timeout=GONE_S)
    assert not alive


def test_a_terminal_that_hangs_up_ends_the_run_with_a_summary_and_whole_records(long_run, tmp_path):
    process, children = long_run
    for _ in range(2):  # from the shell, and from the system
        process.send_signal(signal.SIGHUP)
    _, errors = process.communicate(timeout=GONE_S + 5)
    assert (process.returncode, errors) == (129, "")
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["ended"] == "interrupted"
    assert summary["ticks"] < 36_000
    assert all(finding.good for finding in verify(tmp_path / "run"))
    _, alive = psutil.wait_procs(children, timeout=GONE_S)
    assert not alive


def test_a_hang_up_that_is_ignored_stays_so():
    """As nohup starts a program."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with Interrupt() as interrupt:
            signal.raise_signal(signal.SIGHUP)
            assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
        assert not interrupt.asked
        assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_hang_up_before_the_first_tick_has_its_own_exit_code():
    interrupt = Interrupt()
    with pytest.raises(Interrupted), leaving_when_hung_up(interrupt):
        raise Interrupted("interrupted while it waited for its runners")
    interrupt.hung_up = True
    with pytest.raises(typer.Exit) as left, leaving_when_hung_up(interrupt):
        raise Interrupted("interrupted while it waited for its runners")
    assert left.value.exit_code == 129


FAULTY = """
from swarmwire.agent import Agent, Robot

class Faulty(Agent):
    needs = ("compass",)

    def __init__(self):
        self.steps = 0

    def step(self, robot: Robot) -> None:
        self.steps += 1
        if self.steps == 3:
            raise ZeroDivisionError("the third step is too much")
"""


@pytest.mark.parametrize("runners", ["none", "3", "per-robot"])
def test_an_agent_that_raises_ends_the_run_with_its_robots_name_and_its_own_traceback(tmp_path, runners):
    agent = tmp_path / "faulty.py"
    agent.write_text(FAULTY)
    setting = ["--set", f"robots.flock.agent={agent}:Faulty", "--set", "robots.flock.params={}"]
    ended = swarmwire("run", LOSSY, *setting, "--runners", runners, "--out", tmp_path / "run", "--quiet")
    assert ended.returncode == 1
    assert "the agent of flock-" in ended.stderr
    assert 'raise ZeroDivisionError("the third step is too much")' in ended.stderr
    assert "faulty.py" in ended.stderr


STUCK = """
import threading
from swarmwire.agent import Agent, Robot

class Stuck(Agent):
    def step(self, robot: Robot) -> None:
        threading.Event().wait()
"""


def test_an_interrupt_ends_a_run_that_waits_for_an_agent(tmp_path):
    agent = tmp_path / "stuck.py"
    agent.write_text(STUCK)
    setting = ["--set", f"robots.flock.agent={agent}:Stuck", "--set", "robots.flock.params={}", "--runners", "2"]
    process = started(LOSSY, *setting, "--out", tmp_path / "run")
    children = family(process)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=20)
    assert (process.returncode, errors) == (130, "")
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["ended"] == "interrupted"
    _, alive = psutil.wait_procs(children, timeout=GONE_S)
    assert not alive

"""However a run over processes ends, it says so, and nothing of it is left behind."""

import json
import os
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest

from swarmwire.metrics.run_folder.verify import verify
from tests.support.deploy.commands import LOSSY, family, runners_of, started, swarmwire

LONG = ["--set", "duration_s=3600", "--runners", "4", "--set", "robots.flock.count=8"]
GONE_S = 20.0  # of a machine that is busy: they are gone in a fraction of a second
Act = Callable[[subprocess.Popen[str]], object]


@pytest.fixture
def long_run(tmp_path):
    process = started(LOSSY, *LONG, "--out", tmp_path / "run")
    children = family(process)
    assert len(children) == 5  # an agent host and four runners
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


def kill_agent_host(process: subprocess.Popen[str]) -> None:
    os.killpg(psutil.Process(process.pid).children()[0].pid, signal.SIGKILL)


def hang_up(process: subprocess.Popen[str]) -> None:
    for _ in range(2):  # from the shell, and from the system
        process.send_signal(signal.SIGHUP)


@pytest.mark.parametrize(
    ("act", "code", "said", "ended"),
    [
        (lambda process: runners_of(process)[2].kill(), 1, "was lost", "failed"),
        (kill_agent_host, 1, "was lost", "failed"),
        (lambda process: process.send_signal(signal.SIGINT), 130, "", "interrupted"),
        (hang_up, 129, "", "interrupted"),
    ],
    ids=["a runner is killed", "the agent host and all runners are", "Ctrl-C", "the terminal hangs up"],
)
def test_it_ends_in_order_with_a_summary_and_whole_records(long_run, tmp_path, act: Act, code, said, ended):
    process, children = long_run
    act(process)
    output, errors = process.communicate(timeout=GONE_S + 5)
    assert process.returncode == code
    assert code != 130 or ("interrupted" in output and "4 processes, lockstep" in output)
    assert said in errors
    assert ("flock-" in errors, errors == "") == (bool(said), not said)
    assert "Traceback" not in errors
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert (summary["ended"], summary["ticks"] < 36_000) == (ended, True)
    assert sum(summary["radio"]["fates"].values()) == summary["radio"]["intended"]
    assert all(finding.good for finding in verify(tmp_path / "run"))
    _, alive = psutil.wait_procs(children, timeout=GONE_S)
    assert not alive


AGENTS = """
import threading
from swarmwire.agent import Agent, Robot

class Faulty(Agent):
    def __init__(self):
        self.steps = 0

    def step(self, robot: Robot) -> None:
        print("hello from an agent", flush=True)
        self.steps += 1
        if self.steps == 3:
            raise ZeroDivisionError("the third step is too much")

class Stuck(Agent):
    def step(self, robot: Robot) -> None:
        threading.Event().wait()
"""


def playing(folder: Path, name: str) -> list[str]:
    agent = folder / "agents.py"
    agent.write_text(AGENTS)
    return ["--set", f"robots.flock.agent={agent}:{name}", "--set", "robots.flock.params={}", "--runners", "2"]


def test_an_agent_may_print_and_one_that_raises_ends_the_run_with_its_name_and_traceback(tmp_path):
    ended = swarmwire("run", LOSSY, *playing(tmp_path, "Faulty"), "--out", tmp_path / "run", "--quiet")
    assert ended.returncode == 1
    assert "the agent of flock-" in ended.stderr
    assert 'raise ZeroDivisionError("the third step is too much")' in ended.stderr
    assert "agents.py" in ended.stderr
    assert "hello from an agent" in ended.stdout + ended.stderr


def test_an_interrupt_ends_a_run_that_waits_for_an_agent(tmp_path):
    process = started(LOSSY, *playing(tmp_path, "Stuck"), "--out", tmp_path / "run")
    children = family(process)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=20)
    assert (process.returncode, errors) == (130, "")
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["ended"] == "interrupted"
    _, alive = psutil.wait_procs(children, timeout=GONE_S)
    assert not alive

"""How runs end: limits, stops, killed processes, foreign frames."""

import json
import os
import re
import signal
import subprocess
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import polars as pl
import psutil
import pytest

from swarmwire.comms.base.clock import NS_PER_S, WallClock
from swarmwire.metrics.records.run_folder.reader import RunFolder
from swarmwire.metrics.records.run_folder.table import TableState
from swarmwire.metrics.records.run_folder.verify import check_recording, verify
from swarmwire.metrics.records.run_folder.writer import part_file, parts_of
from tests.support.deploy.runs import (
    LOSSY,
    called,
    family,
    record_run,
    runners_of,
    started,
    started_in_haste,
    swarmwire,
)

LONG = ["--set", "duration_s=3600", "--runners", "4", "--set", "robots.flock.count=8"]
GONE_S = 20.0  # of a machine that is busy: they are gone in a fraction of a second
Act = Callable[[subprocess.Popen[str]], object]
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
DURATION = "duration_s=12"
KILL = 'events=[{at_s=1.0, do="kill", robots={group="flock", share=0.2}}]'
SOME_PERIODS_NS = NS_PER_S // 2  # a recorder's period of two seconds lasts 40 ms here
MOMENTS = [57, "ends"]  # amid its ticks, and while the parts are joined


@pytest.mark.parametrize(
    ("runners", "names"),
    [
        # The last of the names has 15 bytes: the end, which has the number.
        ("per-robot", {"flock-0", "flock-1", "flock-2", "naissance_ten-0"}),
        ("2", {"flock-0+1", "flock-2+1"}),
    ],
)
def test_process_names_of_agents_are_their_robots_and_status_has_the_pid(tmp_path, runners, names):
    other = "robots.reconnaissance_ten={body='epuck', count=1, agent='swarmwire.agent.behaviours:Flocking'}"
    swarm = "--set", "robots.flock.count=3", "--set", other, "--set", "duration_s=3600"
    with started(LOSSY, "--runners", runners, *swarm, "--out", tmp_path / "run") as process:
        try:
            assert {psutil.Process(runner.pid).name() for runner in runners_of(process)} == names
            status = swarmwire("ctl", "--run", tmp_path / "run", "status", "--json")
            assert json.loads(status.stdout)["pid"] == process.pid
        finally:
            process.kill()


@pytest.fixture
def long_run(tmp_path):
    process = started(LOSSY, *LONG, "--out", tmp_path / "run")
    children = family(process)
    assert len(children) == 6  # an agent host, its fork server and four agent processes
    yield process, children
    for survivor in [*children, psutil.Process(process.pid)] if process.poll() is None else children:
        if survivor.is_running():
            survivor.kill()
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


@pytest.mark.parametrize(
    ("act", "code", "text", "ended"),
    [
        (lambda process: runners_of(process)[2].kill(), 1, "was lost", "failed"),
        (kill_agent_host, 1, "was lost", "failed"),
        (lambda process: process.send_signal(signal.SIGINT), 130, "", "interrupted"),
    ],
    ids=["a runner is killed", "the agent host and all runners are", "Ctrl-C"],
)
def test_run_that_is_killed_or_interrupted_ends_with_summary_and_whole_records(
    long_run, tmp_path, act: Act, code, text, ended
):
    process, children = long_run
    act(process)
    output, errors = process.communicate(timeout=GONE_S + 5)
    assert process.returncode == code
    assert code != 130 or ("interrupted" in output and "4 processes, lockstep" in output)
    assert text in errors
    assert ("flock-" in errors, errors == "") == (bool(text), not text)
    assert "Traceback" not in errors
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert (summary["ended"], summary["ticks"] < 36_000) == (ended, True)
    assert sum(summary["radio"]["fates"].values()) == summary["radio"]["intended"]
    assert all(finding.good for finding in verify(tmp_path / "run"))
    _, alive = psutil.wait_procs(children, timeout=GONE_S)
    assert not alive


def playing(folder: Path, name: str) -> list[str]:
    agent = folder / "agents.py"
    agent.write_text(AGENTS)
    return ["--set", f"robots.flock.agent={agent}:{name}", "--set", "robots.flock.params={}", "--runners", "2"]


def test_agent_may_print_and_one_that_raises_ends_the_run_with_a_traceback(tmp_path):
    ended = swarmwire("run", LOSSY, *playing(tmp_path, "Faulty"), "--out", tmp_path / "run", "--quiet")
    assert ended.returncode == 1
    for text in ("the agent of flock-", 'raise ZeroDivisionError("the third step is too much")', "agents.py"):
        assert text in ended.stderr
    assert "hello from an agent" in ended.stdout + ended.stderr


def test_interrupt_ends_a_run_that_waits_for_an_agent(tmp_path):
    process = started(LOSSY, *playing(tmp_path, "Stuck"), "--out", tmp_path / "run")
    children = family(process)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=20)
    assert (process.returncode, errors) == (130, "")
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["ended"] == "interrupted"
    _, alive = psutil.wait_procs(children, timeout=GONE_S)
    assert not alive


@pytest.fixture(scope="module")
def complete(tmp_path_factory):
    """The same run, not killed."""
    folder = tmp_path_factory.mktemp("whole")
    record_run(folder, overrides=[DURATION, KILL])
    return RunFolder(folder)


@pytest.mark.parametrize("moment", MOMENTS)
def test_killed_run_leaves_a_readable_and_true_folder(tmp_path, complete, moment):
    process = started_in_haste(tmp_path, DURATION, KILL)
    with process:
        assert any(line.strip() == str(moment) for line in process.stdout)
        process.kill()
    folder = RunFolder(tmp_path)
    assert folder.summary is None
    assert folder.static == complete.static
    findings = {finding.part: finding for finding in verify(tmp_path)}
    for name in ("ticks", "packets", "events"):
        assert findings[name].state in (TableState.PARTIAL, TableState.INTACT), findings[name]
        parts = parts_of(tmp_path, name)
        assert parts == [part_file(tmp_path, name, number) for number in range(len(parts))] or folder.files(name)
        if folder.files(name) or name != "ticks":
            table = getattr(folder, name)()
            assert table.equals(getattr(complete, name)().head(len(table)))
    if folder.files("ticks"):
        ticks = folder.ticks(0)["tick"].to_list()
        assert ticks == list(range(len(ticks)))
        assert len(folder.robots()) == len(ticks) * complete.static.robots


@pytest.fixture(scope="module")
def killed(tmp_path_factory):
    """A long run's folder, killed amid its ticks; a tick that was over some periods before, and the last that was."""
    folder, clock = tmp_path_factory.mktemp("killed"), WallClock()
    process = started_in_haste(folder, "duration_s=3600", rrd=find_spec("rerun") is not None)
    before, due_ns, numbers = None, 0, list[int]()
    with process:
        ticks = (int(line) for line in process.stdout if line.strip().isdecimal())
        for tick in ticks:
            numbers.append(tick)
            if before is None and len(parts_of(folder, "ticks")) >= 3:
                before, due_ns = tick, clock.now_ns() + SOME_PERIODS_NS
            if before is not None and clock.now_ns() >= due_ns:
                break
        process.kill()
        return folder, before, max(*numbers, *ticks)


def test_killed_run_leaves_its_recording_up_to_the_last_period(killed):
    pytest.importorskip("rerun", reason="needs the extra [view]")
    folder, before, last = killed
    state, text = check_recording(folder / "run.rrd")
    assert state is TableState.PARTIAL
    reach = re.search(r"readable up to tick (\d+); it was never closed$", text)
    assert reach, text
    assert before <= int(reach[1]) <= last + 1  # the recorder sees a tick before it is printed


def test_verify_tells_how_far_a_killed_run_came(killed, monkeypatch, capsys):
    folder, *_ = killed
    last = pl.scan_parquet(parts_of(folder, "ticks")).select(pl.col("tick").max()).collect().item()
    code, out, errors = called(monkeypatch, capsys, "verify", folder)
    assert (code, errors) == (1, "")
    assert f"up to tick {last}" in " ".join(out.split())
    last = out.strip().splitlines()[-1]
    assert last.startswith("not intact: ")
    assert "summary.json missing, ticks partial" in last

"""Limits of the machine: disk, files, threads, memory."""

import ctypes
import errno
import json
import os
import re
import resource
import shutil
import subprocess
import sys
from _thread import start_new_thread

import psutil
import pytest

from swarmwire.comms.base.atomic import write_text
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Truth
from swarmwire.deploy import run
from swarmwire.deploy.machine import WORLD_FILES, WORLD_THREADS, need_open_files, need_threads
from swarmwire.deploy.runs.record import folder, provenance
from swarmwire.metrics.records.run_folder import tables
from swarmwire.metrics.records.run_folder.layout import SUMMARY
from swarmwire.metrics.records.run_folder.table import TableState
from swarmwire.metrics.records.run_folder.verify import verify
from tests.integration.examples.test_examples import EXAMPLES
from tests.support.deploy.runs import LOSSY, called, processes_of, refused_command

SHORT = ("--set", "duration_s=1", "--set", "robots.flock.count=4")
NO_ROOM = "No space left on device"
FULL = OSError(errno.ENOSPC, NO_ROOM)
IN_SMALL = (
    'mount -t tmpfs -o size=40k none "$0" || exit 99; to=$1; shift; "$@"; code=$?; cp -r "$0/run" "$to"; exit $code'
)
THREADS = 6
PROGRAM = f"""
import ctypes, threading
from swarmwire.deploy.machine import share_heaps
SHARED
met, gone = threading.Barrier({THREADS + 1}), threading.Barrier({THREADS + 1})
libc = ctypes.CDLL(None)
libc.malloc.restype, libc.malloc.argtypes = ctypes.c_void_p, [ctypes.c_size_t]
libc.fopen.restype = ctypes.c_void_p
def take():
    met.wait()
    assert libc.malloc(100_000)
    gone.wait()
for _ in range({THREADS}):
    threading.Thread(target=take).start()
met.wait()
gone.wait()
file = libc.fopen(b"/dev/stdout", b"w")
libc.malloc_info(0, ctypes.c_void_p(file))
libc.fflush(ctypes.c_void_p(file))
"""
KEPT_MB = 100
KEEPING = f"""
import numpy, psutil
from swarmwire.comms.base.clock import to_ns
from swarmwire.deploy.machine import keep_memory
from swarmwire.deploy.runs.observers import RETURN_INTERVAL_S, MemoryReturn
from tests.support.clocks import FakeClock
keep_memory()
taken = [numpy.ones(10**6, numpy.int8) for _ in range({KEPT_MB})]
last = numpy.ones(1000)
del taken
clock, rss = FakeClock(), lambda: psutil.Process().memory_info().rss
kept = MemoryReturn(clock)
for _ in range(2):
    before = rss()
    kept.see(None)
    print(before - rss())
    clock.sleep_until(clock.now_ns() + to_ns(RETURN_INTERVAL_S))
"""
SHORT_RUN = ["duration_s=0.5", "robots.flock.count=3"]


def refuses(*_, **__):
    raise FULL


def assert_names(error, path):
    """One line with the path, the cause and the cure."""
    assert error.startswith(f"error: {path} ")
    assert NO_ROOM in error
    assert "df -h" in error
    assert len(error.splitlines()) == 1


def test_run_on_a_full_disk_goes_on_and_its_folder_is_readable(tmp_path):
    disk, copy = tmp_path / "disk", tmp_path / "left"
    disk.mkdir()
    if shutil.which("unshare") is None:
        pytest.skip("mount namespaces: there is no unshare")
    command = [sys.executable, "-m", "swarmwire.deploy", "run", LOSSY, "--set", "duration_s=4", "--out", disk / "run"]
    run = ["unshare", "--mount", "sh", "-c", IN_SMALL, disk, copy, *command]
    done = subprocess.run(list(map(str, run)), capture_output=True, text=True, timeout=100, check=False)
    if not copy.exists():
        pytest.skip(f"mount namespaces: {done.stderr.strip()}")
    assert done.returncode == 1
    *before, last = done.stderr.splitlines()
    assert_names(last, disk / "run" / "summary.json")
    assert before
    assert all(line.startswith("observer ") for line in before)
    assert "4 s in" in done.stdout
    assert "observer_failed_TickRecorder" in done.stdout
    states = {finding.part: finding.state for finding in verify(copy)}
    assert states["static.json"] is states["run.json"] is states["log.txt"] is TableState.INTACT
    assert TableState.DAMAGED not in states.values()


def test_table_that_a_full_disk_refuses_is_exit_code_1_and_the_run_goes_on(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(tables, "write_text", refuses)
    code, out, errors = called(monkeypatch, capsys, "run", LOSSY, *SHORT, "--out", tmp_path / "run")
    assert code == 1
    failed, last = errors.splitlines()
    assert failed.startswith("observer StaticRecorder failed: ")
    assert last.startswith(f"error: {tmp_path}/run: incomplete: StaticRecorder ")
    assert "trajectory" in out
    summary = json.loads((tmp_path / "run" / SUMMARY).read_text())
    assert (summary["ended"], summary["counts"]["observer_failed_StaticRecorder"]) == ("duration", 1)


def test_film_on_a_full_disk_is_refused_in_one_line(tmp_path):
    disk = tmp_path / "disk"
    disk.mkdir()
    run(LOSSY, overrides=SHORT_RUN, out=tmp_path / "run")
    if shutil.which("unshare") is None:
        pytest.skip("mount namespaces: there is no unshare")
    script = 'mount -t tmpfs -o size=4k none "$0" || exit 99; "$@"'
    export = [sys.executable, "-m", "swarmwire.deploy", "export", tmp_path / "run", "--to", disk / "film.mp4"]
    command = ["unshare", "--mount", "sh", "-c", script, disk, *export]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=100, check=False)
    if done.returncode == 99:
        pytest.skip(f"mount namespaces: {done.stderr.strip()}")
    assert done.returncode == 2
    assert done.stderr.startswith(f"error: {disk}/film.mp4: ")
    assert NO_ROOM in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("limit_kb", "expected"), [(600_000, "ulimit -v"), (1_500_000, "expected a limit of at least")]
)
def test_too_few_addresses_are_one_line_and_nothing_begins(tmp_path, limit_kb, expected):
    limited = f'ulimit -v {limit_kb}; exec "$0" "$@"'
    swarmwire = [sys.executable, "-m", "swarmwire.deploy", "run", LOSSY, *SHORT, "--out", tmp_path / "run"]
    command = ["sh", "-c", limited, *map(str, swarmwire)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode in (1, 2)
    assert expected in done.stderr
    assert "ulimit -v" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "run").exists()


def test_summary_on_a_full_disk_costs_nobody_the_result(tmp_path, monkeypatch, capsys):
    def write_others(path, text):
        (refuses if path.name == SUMMARY else write_text)(path, text)

    monkeypatch.setattr(folder, "write_text", write_others)
    code, out, errors = called(monkeypatch, capsys, "run", LOSSY, *SHORT, "--out", tmp_path / "run")
    assert code == 1
    assert_names(errors, tmp_path / "run" / "summary.json")
    assert "trajectory" in out
    assert (tmp_path / "run" / "ticks.parquet").exists()


def test_disk_that_is_full_from_the_start_is_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(provenance, "write_text", refuses)
    code, out, errors = called(monkeypatch, capsys, "run", LOSSY, *SHORT, "--out", tmp_path / "run")
    assert (code, out) == (1, "")
    assert_names(errors, tmp_path / "run")
    assert f"failed to start: {tmp_path}/run " in (tmp_path / "run" / "log.txt").read_text()


@pytest.fixture
def few_files():
    """The limit is low, and may be raised."""
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (WORLD_FILES + 100, before[1]))
    yield before[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, before)


def test_limit_of_open_files_is_raised_as_far_as_a_run_needs(few_files):
    need_open_files(100)
    assert resource.getrlimit(resource.RLIMIT_NOFILE) == (WORLD_FILES + 100, few_files)
    need_open_files(200)
    assert resource.getrlimit(resource.RLIMIT_NOFILE) == (WORLD_FILES + 200, few_files)


def test_open_files_too_few_for_all_runners_stop_a_run_before_it_begins(tmp_path):
    few = "import resource, sys; resource.setrlimit(resource.RLIMIT_NOFILE, (64, 64)); "
    call = "from swarmwire.deploy.cli.app import main; sys.argv[0] = 'swarmwire'; main()"
    command = [sys.executable, "-c", few + call, "run", LOSSY, "--runners", "per-robot", "--out", tmp_path / "run"]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert re.search(f"error: this machine: .*at least {WORLD_FILES + 20} open files.*got 64 .*ulimit -n", line)
    assert not (tmp_path / "run").exists()


def test_threads_too_few_for_all_runners_stop_a_run_before_it_begins(tmp_path, monkeypatch, capsys):
    started, start = [], start_new_thread

    def limited(*arguments):
        if len(started) == WORLD_THREADS:
            raise RuntimeError("can't start new thread")
        started.append(start(*arguments))

    monkeypatch.setattr("swarmwire.deploy.machine.start_new_thread", limited)
    command = ("run", LOSSY, "--runners", "10", "--out", tmp_path / "run")
    match = f"this machine: .*for 10 runners.*got {WORLD_THREADS} .*ulimit -u"
    refused_command(monkeypatch, capsys, *command, match=match)
    assert not (tmp_path / "run").exists()


def test_threads_of_a_few_runners_and_no_billion_files_fit_a_machine():
    need_threads(10)
    with pytest.raises(BadInput, match="open files .*1000000000 runners"):
        need_open_files(1_000_000_000)


def heaps(first: str) -> int:
    """How many heaps a process has whose threads all took memory at the same time."""
    command = [sys.executable, "-c", PROGRAM.replace("SHARED", first)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    return done.stdout.count("<heap nr=")


@pytest.mark.skipif(
    not hasattr(ctypes.CDLL(None), "malloc_info"), reason="only glibc, whose heaps these are, tells how many there are"
)
def test_threads_share_two_heaps() -> None:
    assert heaps("share_heaps()") == 2 < heaps("")


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "malloc_trim"), reason="only glibc keeps memory so, and returns it")
def test_memory_kept_by_the_heap_is_returned_once_a_minute() -> None:
    done = subprocess.run([sys.executable, "-c", KEEPING], capture_output=True, text=True, check=True, timeout=60)
    at_first, after_a_minute = map(int, done.stdout.split())
    assert at_first < 1e6 * KEPT_MB / 10
    assert after_a_minute > 1e6 * KEPT_MB * 9 / 10


class Policies(Observer):
    """Observer that asks how the system schedules each runner."""

    def __init__(self) -> None:
        self.numbers = list[int]()

    def see(self, truth: Truth) -> None:
        """Ask, in every tick."""
        self.numbers = [os.sched_getscheduler(process.pid) for process in processes_of(psutil.Process())]


@pytest.mark.skipif(not hasattr(os, "SCHED_BATCH"), reason="the system has no scheduling in batches")
@pytest.mark.parametrize(("realtime", "policy"), [(None, "SCHED_BATCH"), (2.0, "SCHED_OTHER")])
def test_runners_take_turns_in_lockstep_and_start_at_once_in_real_time(realtime: float | None, policy: str) -> None:
    policies = Policies()
    run(EXAMPLES / "protocol" / "flock.toml", overrides=SHORT_RUN, runners=2, realtime=realtime, observers=[policies])
    assert policies.numbers == [getattr(os, policy)] * 2

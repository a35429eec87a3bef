"""Open files and threads: raised where that is allowed, and refused in a line before anything begins."""

import resource
import subprocess
import sys
from _thread import start_new_thread

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.host import OWN_FILES, OWN_THREADS, need_open_files, need_threads
from tests.support.deploy.commands import LOSSY, called


@pytest.fixture
def few_files():
    """The limit is low, and may be raised."""
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (OWN_FILES + 100, before[1]))
    yield before[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, before)


def test_a_run_raises_its_limit_of_open_files_as_far_as_it_needs(few_files):
    need_open_files(100)
    assert resource.getrlimit(resource.RLIMIT_NOFILE) == (OWN_FILES + 100, few_files)
    need_open_files(200)
    assert resource.getrlimit(resource.RLIMIT_NOFILE) == (OWN_FILES + 200, few_files)


def test_where_files_are_too_few_for_all_runners_nothing_begins(tmp_path):
    few = "import resource, sys; resource.setrlimit(resource.RLIMIT_NOFILE, (64, 64)); "
    call = "from swarmwire.deploy.cli.app import main; sys.argv[0] = 'swarmwire'; main()"
    command = [sys.executable, "-c", few + call, "run", LOSSY, "--runners", "per-robot", "--out", tmp_path / "run"]
    told = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=100, check=False)
    assert told.returncode == 2
    (line,) = told.stderr.splitlines()
    for said in ("error: this machine: ", f"at least {OWN_FILES + 20} open files", "got 64 ", "ulimit -n"):
        assert said in line
    assert not (tmp_path / "run").exists()


def test_where_threads_are_too_few_nothing_begins(tmp_path, monkeypatch, capsys):
    started, start = [], start_new_thread

    def limited(*arguments):
        if len(started) == OWN_THREADS:
            raise RuntimeError("can't start new thread")
        started.append(start(*arguments))

    monkeypatch.setattr("swarmwire.deploy.host.start_new_thread", limited)
    code, _, errors = called(monkeypatch, capsys, "run", LOSSY, "--runners", "10", "--out", tmp_path / "run")
    assert code == 2
    assert errors.startswith("error: this machine: ")
    for said in ("for 10 runners", f"got {OWN_THREADS} ", "ulimit -u"):
        assert said in errors
    assert not (tmp_path / "run").exists()


def test_a_machine_has_room_for_the_threads_of_a_few_runners():
    need_threads(10)
    with pytest.raises(BadInput, match="open files .*1000000000 runners"):
        need_open_files(1_000_000_000)

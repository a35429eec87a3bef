"""A disk that is full: what it refuses is told in a line each, the run goes on, and what it came to is shown."""

import errno
import shutil
import subprocess
import sys

import pytest

from swarmwire.deploy.record import provenance
from swarmwire.deploy.result import Result
from swarmwire.metrics.run_folder.table import State
from swarmwire.metrics.run_folder.verify import verify
from tests.support.deploy.commands import LOSSY, called

SHORT = ("--set", "duration_s=1", "--set", "robots.flock.count=4")
NO_ROOM = "No space left on device"
FULL = OSError(errno.ENOSPC, NO_ROOM)
IN_SMALL = (
    'mount -t tmpfs -o size=40k none "$0" || exit 99; to=$1; shift; "$@"; code=$?; cp -r "$0/run" "$to"; exit $code'
)


def refuses(*_, **__):
    raise FULL


def assert_names(error, path):
    """One line with the path, the cause and the cure."""
    assert error.startswith(f"error: {path} ")
    assert NO_ROOM in error
    assert "df -h" in error
    assert len(error.splitlines()) == 1


def test_a_run_on_a_disk_that_is_full_goes_on_and_its_folder_is_readable(tmp_path):
    disk, left = tmp_path / "disk", tmp_path / "left"
    disk.mkdir()
    if shutil.which("unshare") is None:
        pytest.skip("mount namespaces: there is no unshare")
    command = [sys.executable, "-m", "swarmwire.deploy", "run", LOSSY, "--set", "duration_s=4", "--out", disk / "run"]
    run = ["unshare", "--mount", "sh", "-c", IN_SMALL, disk, left, *command]
    told = subprocess.run(list(map(str, run)), capture_output=True, text=True, timeout=100, check=False)
    if not left.exists():
        pytest.skip(f"mount namespaces: {told.stderr.strip()}")
    assert told.returncode == 1
    *before, last = told.stderr.splitlines()
    assert_names(last, disk / "run" / "summary.json")
    assert before
    assert all(line.startswith("observer ") for line in before)
    assert "4 s in" in told.stdout
    assert "observer_failed_TickRecorder" in told.stdout
    states = {finding.part: finding.state for finding in verify(left)}
    assert states["static.json"] is states["run.json"] is states["log.txt"] is State.INTACT
    assert State.DAMAGED not in states.values()


def test_a_disk_without_room_for_the_summary_costs_nobody_the_result(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(Result, "write", refuses)
    code, out, errors = called(monkeypatch, capsys, "run", LOSSY, *SHORT, "--out", tmp_path / "run")
    assert code == 1
    assert_names(errors, tmp_path / "run" / "summary.json")
    assert "trajectory" in out
    assert (tmp_path / "run" / "ticks.parquet").exists()


def test_a_disk_that_is_full_from_the_start_is_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(provenance, "write_text", refuses)
    code, out, errors = called(monkeypatch, capsys, "run", LOSSY, *SHORT, "--out", tmp_path / "run")
    assert (code, out) == (1, "")
    assert_names(errors, tmp_path / "run")
    assert f"failed to start: {tmp_path}/run " in (tmp_path / "run" / "log.txt").read_text()

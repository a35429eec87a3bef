"""Runs of this machine find each other, in a folder of the user's own; runs that were killed are forgotten."""

import json
import os

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.control import run_finder
from swarmwire.deploy.control.run_finder import Announced, FoundRun, find_run, found_runs, runs_folder
from swarmwire.deploy.live.following import Live
from tests.support.metrics.truths import static

NOBODY = 2**22 + 1  # more than Linux gives out


@pytest.fixture(autouse=True)
def runtime(tmp_path, monkeypatch):
    """A private folder for this test's runs."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return tmp_path / "swarmwire"


def announced(folder, run, pid=None):
    """A run that is announced, as far as files go."""
    folder.mkdir()
    Live("unixsock-stream//nowhere", run, pid or os.getpid()).write(folder)
    found = Announced(folder)
    found.begin(static(2))
    return found


def test_a_run_is_found_for_as_long_as_it_goes_on(tmp_path, runtime):
    assert found_runs() == []
    run = announced(tmp_path / "a", "r1")
    [found] = found_runs()
    assert found == FoundRun("r1", "unixsock-stream//nowhere", os.getpid(), static(2).name, str(tmp_path / "a"))
    assert find_run(None) == find_run("r1") == find_run("r") == found
    assert find_run(str(tmp_path / "a")).run == "r1"
    assert run.end(None) == {}
    assert found_runs() == []
    assert list(runtime.iterdir()) == []


def test_a_run_that_was_killed_is_forgotten_and_what_is_no_run_is_removed(tmp_path, runtime):
    folder = runs_folder()
    killed = FoundRun("r1", "e", NOBODY, "s", "f")
    (folder / "r1.json").write_text(json.dumps(vars(killed)))
    (folder / "r2.json").write_text("[]")
    (folder / ".aside-r3.json").write_text("")
    assert found_runs() == []
    assert [path.name for path in runtime.iterdir()] == [".aside-r3.json"]


def test_which_run_is_meant_must_be_clear(tmp_path):
    with pytest.raises(BadInput, match="none"):
        find_run(None)
    for run in ("aa1", "ab2"):
        announced(tmp_path / run, run)
    with pytest.raises(BadInput, match=r"several.* aa1 \(.*\), ab2 \("):
        find_run(None)
    with pytest.raises(BadInput, match="several.* aa1 .*ab2"):
        find_run("a")
    assert find_run("ab").run == "ab2"
    with pytest.raises(BadInput, match="aa1, ab2"):
        find_run("b")
    (tmp_path / "empty").mkdir()
    with pytest.raises(BadInput, match="empty: expected the folder of a run"):
        find_run(str(tmp_path / "empty"))


def test_a_folder_that_others_may_write_to_is_not_believed(tmp_path, runtime):
    assert runs_folder().stat().st_mode & 0o777 == 0o700
    runtime.chmod(0o755)
    with pytest.raises(BadInput, match="closed to others"):
        runs_folder()
    runtime.rmdir()
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    runtime.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(BadInput, match="that is the user's"):
        runs_folder()


def test_without_a_runtime_folder_it_is_one_among_the_temporary_files(tmp_path, monkeypatch):
    monkeypatch.delenv("XDG_RUNTIME_DIR")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert runs_folder() == tmp_path / f"swarmwire-{os.getuid()}"


def test_a_runtime_folder_of_another_user_is_passed_over(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setattr("os.getuid", lambda: tmp_path.stat().st_uid + 1)
    assert run_finder._is_own(tmp_path) is False
    with pytest.raises(BadInput, match=f"swarmwire-{os.getuid()}"):  # which is of another user here, too
        runs_folder()

"""A campaign that was ended at any moment is gone on with, and comes to what it would have come to."""

import errno
import json
from shutil import copytree

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy import resume, sweep
from swarmwire.deploy.campaign import store
from swarmwire.deploy.campaign import sweep as sweeping
from swarmwire.deploy.campaign.store import StorageFailed
from swarmwire.metrics.campaign.spec import read_campaign
from tests.support.deploy.campaign import InThisProcess, rows_in, scenario_in, series_in
from tests.support.deploy.runs import called

VARY = {"radio.loss": [0.0, 0.5]}
ASKED = {"seeds": 2, "vary": VARY, "batch": 2}


class Killed(BaseException):
    """Stands for a process that is no more."""


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """A campaign that was left alone."""
    folder = tmp_path_factory.mktemp("undisturbed")
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(sweeping, "open_executor", lambda *_: InThisProcess())
        sweep(scenario_in(folder, "stumbling.py:Stumbling"), out=folder / "whole", **ASKED)
    return folder / "whole"


@pytest.fixture
def whole(undisturbed, tmp_path, here):
    """A copy of it."""
    return copytree(undisturbed, tmp_path / "whole")


def dying_at(monkeypatch, count, error):
    """The write of this number, counted from 0, is the last that is tried; how many there were."""
    write, tried = store._write, []

    def dying(path, data):
        tried.append(path)
        if len(tried) > count:
            raise error
        write(path, data)

    monkeypatch.setattr(store, "_write", dying)
    return tried


def same(folder, whole):
    assert rows_in(folder) == rows_in(whole)
    assert series_in(folder).equals(series_in(whole), null_equal=True)
    assert sorted(path.name for path in folder.iterdir()) == sorted(path.name for path in whole.iterdir())


WRITES = 5  # two tasks of rows and series each, and the table


@pytest.mark.parametrize("count", range(WRITES))
def test_whichever_write_was_the_last_nothing_is_lost_or_there_twice(tmp_path, stumbling, whole, monkeypatch, count):
    folder = tmp_path / "died"
    with monkeypatch.context() as patched:
        tried = dying_at(patched, count, Killed())
        with pytest.raises(Killed):
            sweep(stumbling, out=folder, **ASKED)
    assert len(tried) == count + 1
    before, rows = rows_in(folder), rows_in(whole)
    assert len(before) == 2 * (count // 2)
    assert all(row in rows for row in before)
    assert resume(folder).is_over
    same(folder, whole)


def test_only_what_is_missing_is_run(whole, here):
    (whole / "summary.parquet").unlink()
    assert resume(whole).done == 4
    assert resume(whole).is_over
    assert [len(executor.tasks) for executor in here] == [0, 0]


def test_failed_runs_stay_unless_they_are_to_be_tried_again(tmp_path, whole):
    rows = rows_in(whole)
    failed = [row["run"] for row in rows if row["ended"] == "failed"]
    assert failed
    assert resume(whole).failed == len(failed)
    agent = whole / "scenario" / "files" / "stumbling.py"
    campaign = read_campaign(whole)
    agent.write_text(agent.read_text().replace("< self.share", "< 0.0"))
    with pytest.raises(BadInput, match="scenario/files/stumbling.py"):
        resume(whole, retry_failed=True)
    _say_as_it_is_now(whole, agent)
    done = resume(whole, retry_failed=True)
    assert (done.is_over, done.failed) == (True, 0)
    assert [row for row in rows_in(whole) if row["run"] not in failed] == [
        row for row in rows if row["run"] not in failed
    ]
    assert set(series_in(whole)["run"]) == set(range(campaign.runs))
    assert len(series_in(whole)) == 5 * campaign.runs


def _say_as_it_is_now(folder, agent):
    import hashlib

    found = json.loads((folder / "campaign.json").read_text())
    for file in found["files"]:
        if file["path"].endswith(agent.name):
            file["sha256"] = hashlib.sha256(agent.read_bytes()).hexdigest()
    (folder / "campaign.json").write_text(json.dumps(found))


def test_other_code_versions_and_machines_are_refused_unless_people_insist(whole):
    found = json.loads((whole / "campaign.json").read_text())
    for key, value, told in (
        ("modules", {**found["modules"], "swarmwire.world": "0"}, "swarmwire.world"),
        ("versions", {**found["versions"], "numpy": "1.0"}, r"numpy.* 1\.0"),
        ("cpu", "another", "CPU.* another"),
    ):
        (whole / "campaign.json").write_text(json.dumps({**found, key: value}))
        with pytest.raises(BadInput, match=f"^--resume {whole}: .*{told}.*--force"):
            resume(whole)
        assert resume(whole, force=True).is_over


@pytest.mark.parametrize("text", [None, "{", "[]", '{"format": 1}', '{"format": 2}'])
def test_a_folder_that_is_no_campaign_is_refused_in_a_line(tmp_path, text):
    if text is not None:
        (tmp_path / "campaign.json").write_text(text)
    with pytest.raises(BadInput, match=f"^{tmp_path}.*expected ") as refused:
        resume(tmp_path)
    assert "\n" not in str(refused.value)


def test_a_folder_is_for_one_process_at_a_time(whole):
    with store.locked(whole, "campaign"), pytest.raises(BadInput, match="another process is at work"):
        resume(whole)


FULL = OSError(errno.ENOSPC, "No space left on device")


def test_a_disk_that_is_full_at_some_time_loses_nothing_that_is_done(tmp_path, scenario, here, monkeypatch):
    folder, count = tmp_path / "c", 3
    with monkeypatch.context() as patched:
        dying_at(patched, count, FULL)
        with pytest.raises(StorageFailed) as told:
            sweep(scenario, out=folder, **ASKED)
    assert str(told.value).startswith(f"{folder}: ")
    assert "No space left on device" in str(told.value)
    assert str(told.value).endswith(f"swarmwire sweep --resume {folder}")
    assert len(rows_in(folder)) == 2 * (count // 2)
    assert here[0].closed
    assert resume(folder).is_over
    assert len(rows_in(folder)) == 4


def test_the_command_line_says_so_in_one_line(tmp_path, scenario, here, monkeypatch, capsys):
    with monkeypatch.context() as patched:
        dying_at(patched, 2, FULL)
        code, _, errors = called(
            patched, capsys, "sweep", scenario, "--seeds", "2", "--batch", "1", "--out", tmp_path / "c"
        )
    assert code == 1
    assert errors.startswith(f"error: {tmp_path / 'c'}: ")
    assert errors.count("\n") == 1


def test_series_that_cannot_be_joined_are_no_loss_either(tmp_path, scenario, here, monkeypatch):
    import polars as pl

    sink = pl.LazyFrame.sink_parquet

    def full(frame, path, **options):
        if "worker-" in str(path):
            raise pl.exceptions.ComputeError("No space left on device (os error 28)")
        return sink(frame, path, **options)

    with monkeypatch.context() as patched:
        patched.setattr(pl.LazyFrame, "sink_parquet", full)
        with pytest.raises(StorageFailed, match="No space left"):
            sweep(scenario, out=tmp_path / "c", **ASKED)
    assert len(rows_in(tmp_path / "c")) == 4
    assert not list((tmp_path / "c" / "series").glob("worker-*"))
    assert resume(tmp_path / "c").is_over
    assert "series" in [path.name for path in (tmp_path / "c").iterdir()]

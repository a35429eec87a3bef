"""A full disk is one line; what is done stays readable, and the campaign can be gone on with."""

import errno

import pytest

from swarmwire.deploy import resume, sweep
from swarmwire.deploy.campaign.store import StorageFailed
from tests.integration.deploy.campaign.test_resume import ASKED, dying_at
from tests.support.deploy.campaign import rows_in
from tests.support.deploy.commands import called

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

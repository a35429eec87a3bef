"""Executors by name, and what they may send to workers that see another file system."""

from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.campaign import executor
from swarmwire.deploy.campaign.executor import open_executor
from swarmwire.deploy.campaign.local_executor import LocalExecutor, usable_cores
from swarmwire.deploy.campaign.messages import receive, send
from swarmwire.deploy.campaign.run_task import run_task
from swarmwire.deploy.campaign.shipped import scenario_files, unpacked
from swarmwire.deploy.campaign.task import Task


def opened(on, workers, scenario):
    return on, workers, scenario


def test_an_executor_of_a_package_goes_by_the_name_before_its_address(monkeypatch, tmp_path):
    point = EntryPoint("made-up", f"{__name__}:opened", executor.GROUP)
    monkeypatch.setattr(EntryPoint, "load", lambda _: opened)
    monkeypatch.setattr(executor, "entry_points_of", lambda group: [point] if group == executor.GROUP else [])
    assert open_executor("made-up://there:1", 3, tmp_path) == ("made-up://there:1", 3, tmp_path)
    with pytest.raises(BadInput, match=r"^--on: expected .*local.*made-up.*; got 'mad-up://there'"):
        open_executor("mad-up://there", None, tmp_path)


def test_by_default_there_is_a_worker_for_each_core():
    found = open_executor("local", None, Path())
    assert isinstance(found, LocalExecutor)
    assert found.slots == usable_cores() >= 1
    found.close()
    with pytest.raises(BadInput, match="^--workers: expected at least 1, got 0"):
        open_executor("local", 0, Path())


def test_a_scenario_that_was_shipped_gives_the_same_rows(tmp_path, stumbling):
    files = scenario_files(tmp_path)
    assert set(files) == {"two.toml", "stumbling.py"}
    folder = unpacked(files)
    assert unpacked(files) == folder
    assert scenario_files(folder) == files
    assert unpacked({**files, "two.toml": files["two.toml"] + b"#"}) != folder
    there = run_task(Task(str(folder / "two.toml"), (), 0, (0, 1), (1, 2)))
    here = run_task(Task(str(stumbling), (), 0, (0, 1), (1, 2)))
    measured = [
        {name: row[name] for name in row if not name.startswith("timing_")} for row in (*here.rows, *there.rows)
    ]
    assert measured[:2] == measured[2:]
    assert here.series == there.series


def test_a_message_comes_whole_or_not_at_all(tmp_path):
    path = tmp_path / "messages"
    with path.open("wb") as file:
        send(file, {"a": [1, None, "x"], "b": b"\0"})
        send(file, {})
    whole = path.read_bytes()
    with path.open("rb") as file:
        assert [receive(file), receive(file), receive(file)] == [{"a": [1, None, "x"], "b": b"\0"}, {}, None]
    for length in range(1, whole.index(b"x")):
        path.write_bytes(whole[:length])
        with path.open("rb") as file:
            assert receive(file) is None

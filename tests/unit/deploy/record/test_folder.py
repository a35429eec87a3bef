"""A run folder belongs to one run."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier

import pytest

from swarmwire.comms.clock import WallClock
from swarmwire.comms.errors import BadInput
from swarmwire.deploy.record.folder import RunFolder

RUNS = 4


def take(folder: Path) -> None:
    RunFolder(folder, WallClock()).failed_to_start(RuntimeError, RuntimeError("no agents"), None)


@pytest.mark.parametrize("exists", [False, True])
def test_of_runs_that_find_a_folder_empty_at_once_one_gets_it(tmp_path, monkeypatch, exists):
    folder, all_have_looked, looks = tmp_path / "run", Barrier(RUNS), Path.iterdir
    if exists:
        folder.mkdir()

    def look(path):
        found = list(looks(path))
        all_have_looked.wait(20)
        return iter(found)

    monkeypatch.setattr(Path, "iterdir", look)
    with ThreadPoolExecutor(RUNS) as runs:
        refusals = [run.exception() for run in [runs.submit(take, folder) for _ in range(RUNS)]]
    refused = [refusal for refusal in refusals if refusal is not None]
    assert len(refused) == RUNS - 1
    assert {type(refusal) for refusal in refused} == {BadInput}
    assert all(str(refusal).startswith(f"--out: {folder}: ") for refusal in refused)

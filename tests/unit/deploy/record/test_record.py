"""A run folder belongs to one run; its recording and the record of live events say what the run says."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier
from typing import Any

import numpy as np
import pytest

from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy import Simulation, repeat, run
from swarmwire.deploy.runs.config import Recording
from swarmwire.deploy.runs.record.folder import RunWriter
from swarmwire.deploy.runs.record.replay_logs import LiveEventsLog, read_live_events
from swarmwire.metrics.records.run_folder.layout import LIVE_EVENTS
from swarmwire.world.live_events import LiveEvent
from tests.integration.metrics.viewer.test_recording import class_names, column
from tests.support.deploy.joiners import Watcher
from tests.support.deploy.runs import LOSSY
from tests.support.refusals import refused_input

pytest.importorskip("rerun", reason="needs the extra [view]")

DURATION_S, RATE_HZ = 8, 10


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A run of a flock in which a fifth dies after 4 s: its recording, its result and its ticks."""
    out, watcher = tmp_path_factory.mktemp("runs") / "run", Watcher()
    event = 'events=[{at_s=4.0,do="kill",robots={group="flock",share=0.2}}]'
    result = run(LOSSY, overrides=[f"duration_s={DURATION_S}", event], out=out, observers=[watcher])
    return out / "run.rrd", result, watcher.truths


def test_positions_and_who_is_dead_are_the_runs(recorded):
    rrd, _, ticks = recorded
    positions = column(rrd, "/world/robots", "Points2D:positions")
    assert list(positions) == list(range(DURATION_S * RATE_HZ))
    for moment in ticks:
        assert positions[moment.tick] == moment.pose[:, :2].astype(np.float32).tolist()
    names, classes = class_names(rrd), column(rrd, "/world/robots", "Points2D:class_ids")
    dead = {tick: sum(names[one][0] == "dead" for one in row) for tick, row in classes.items()}
    assert dead == {0: 0, 40: 4}


RUNS = 4


def take(folder: Path) -> None:
    RunWriter(folder, WallClock()).failed_to_start(RuntimeError, RuntimeError("no agents"), None)


@pytest.mark.parametrize("exists", [False, True])
def test_empty_folder_found_by_several_runs_goes_to_one(tmp_path, monkeypatch, exists):
    folder, all_have_looked, looks = tmp_path / "run", Barrier(RUNS), Path.iterdir
    if exists:
        folder.mkdir()

    def look(path):
        results = list(looks(path))
        all_have_looked.wait(20)
        return iter(results)

    monkeypatch.setattr(Path, "iterdir", look)
    with ThreadPoolExecutor(RUNS) as runs:
        refusals = [run.exception() for run in [runs.submit(take, folder) for _ in range(RUNS)]]
    refused = [refusal for refusal in refusals if refusal is not None]
    assert len(refused) == RUNS - 1
    assert {type(refusal) for refusal in refused} == {BadInput}
    assert all(str(refusal).startswith(f"out: {folder}: ") for refusal in refused)


KILL: dict[str, Any] = {"do": "kill", "robots": {"names": ["flock-1"]}}
DONE = (LiveEvent(3, 0, KILL), LiveEvent(9, 0, None))


@pytest.fixture
def log(tmp_path) -> LiveEventsLog:
    log = LiveEventsLog(tmp_path)
    for one in DONE:
        log.keep(one)
    return log


def test_live_events_are_read_back_with_the_same_hash(tmp_path, log):
    record = log.record()
    assert (record.path, record.lines) == (LIVE_EVENTS, 2)
    assert read_live_events(tmp_path) == (DONE, record.sha256)


def test_live_events_of_an_undisturbed_run_have_no_record(tmp_path):
    assert LiveEventsLog(tmp_path).record() is None
    assert read_live_events(tmp_path) == ((), None)


def test_live_events_line_that_was_cut_off_is_passed_over(tmp_path, log):
    record, path = log.record(), tmp_path / LIVE_EVENTS
    path.write_bytes(path.read_bytes() + b'{"tick": 12, "num')
    assert read_live_events(tmp_path) == (DONE, record.sha256)
    path.write_bytes(b'{"tick"')
    assert read_live_events(tmp_path) == ((), None)


@pytest.mark.parametrize(
    "line",
    [
        *("no json", "[]", "3", "{}", '{"tick": 1, "number": 2}', '{"tick": "1", "number": 2, "end": true}'),
        *('{"tick": 1, "number": 2, "event": "kill"}', '{"tick": 1, "number": 2, "end": false}'),
    ],
)
def test_live_events_line_that_is_invalid_is_refused_by_its_number(tmp_path, log, line):
    path = tmp_path / LIVE_EVENTS
    path.write_text(path.read_text() + line + "\n")
    with refused_input(match="line 3: "):
        read_live_events(tmp_path)


def test_after_a_line_that_could_not_be_written_there_is_no_other(tmp_path):
    log = LiveEventsLog(tmp_path / "nowhere")
    for _ in range(2):
        with pytest.raises(OSError):
            log.keep(DONE[0])
    (tmp_path / "nowhere").mkdir()
    with pytest.raises(OSError, match="before"):
        log.keep(DONE[0])
    assert log.record() is None


def test_live_event_that_cannot_be_recorded_does_not_happen(tmp_path, capsys):
    (tmp_path / "run").mkdir()
    record = Recording(rrd=False, tables=False)
    with Simulation(LOSSY, overrides=["duration_s=1"], out=tmp_path / "run", record=record) as simulation:
        (tmp_path / "run" / LIVE_EVENTS).mkdir()
        simulation.apply_event(KILL)
        simulation.run()
        (tmp_path / "run" / LIVE_EVENTS).rmdir()
    assert simulation.result.events == ()
    assert "event 0 does not happen" in capsys.readouterr().err
    assert repeat(tmp_path / "run").same


def test_repeat_without_or_with_changed_live_events_is_refused(tmp_path):
    record = Recording(rrd=False, tables=False)
    with Simulation(LOSSY, overrides=["duration_s=1"], out=tmp_path / "run", record=record) as simulation:
        simulation.apply_event(KILL)
        simulation.run()
    path = tmp_path / "run" / LIVE_EVENTS
    path.write_text(path.read_text().replace("flock-1", "nobody"))
    with refused_input(match="event 0: robots.names: "):
        repeat(tmp_path / "run")
    path.unlink()
    with refused_input(match=LIVE_EVENTS):
        repeat(tmp_path / "run")

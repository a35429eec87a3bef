"""What people did to a run is on record line by line; a line that is cut off is passed over, another is refused."""

import json
from typing import Any

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy import Simulation, repeat
from swarmwire.deploy.config import Recording
from swarmwire.deploy.record.live_events import LiveEventsLog, read_live_events
from swarmwire.metrics.run_folder.layout import LIVE_EVENTS
from swarmwire.world.live_events import LiveEvent
from tests.support.deploy.commands import LOSSY

KILL: dict[str, Any] = {"do": "kill", "robots": {"names": ["flock-1"]}}
DONE = (LiveEvent(3, 0, KILL), LiveEvent(9, 0, None))


@pytest.fixture
def log(tmp_path) -> LiveEventsLog:
    log = LiveEventsLog(tmp_path)
    for one in DONE:
        log.keep(one)
    return log


def test_what_was_kept_is_read_with_the_same_hash(tmp_path, log):
    record = log.record()
    assert record is not None
    assert (record.path, record.lines) == (LIVE_EVENTS, 2)
    assert read_live_events(tmp_path) == (DONE, record.sha256)


def test_a_run_to_which_nothing_was_done_has_no_record(tmp_path):
    assert LiveEventsLog(tmp_path).record() is None
    assert read_live_events(tmp_path) == ((), None)


def test_a_line_that_was_cut_off_is_passed_over(tmp_path, log):
    record, path = log.record(), tmp_path / LIVE_EVENTS
    assert record is not None
    path.write_bytes(path.read_bytes() + b'{"tick": 12, "num')
    assert read_live_events(tmp_path) == (DONE, record.sha256)
    path.write_bytes(b'{"tick"')
    assert read_live_events(tmp_path) == ((), None)


@pytest.mark.parametrize(
    "line",
    [
        "no json",
        "[]",
        "3",
        "{}",
        json.dumps({"tick": 1, "number": 2}),
        json.dumps({"tick": "1", "number": 2, "end": True}),
        json.dumps({"tick": 1, "number": 2, "event": "kill"}),
        json.dumps({"tick": 1, "number": 2, "end": False}),
    ],
)
def test_a_line_that_is_none_of_ours_is_named(tmp_path, log, line):
    path = tmp_path / LIVE_EVENTS
    path.write_text(path.read_text() + line + "\n")
    with pytest.raises(BadInput, match="line 3: ") as caught:
        read_live_events(tmp_path)
    assert "\n" not in str(caught.value)


def test_after_a_line_that_could_not_be_written_there_is_no_other(tmp_path):
    log = LiveEventsLog(tmp_path / "nowhere")
    for _ in range(2):
        with pytest.raises(OSError):
            log.keep(DONE[0])
    (tmp_path / "nowhere").mkdir()
    with pytest.raises(OSError, match="before"):
        log.keep(DONE[0])
    assert log.record() is None


def test_an_event_that_cannot_be_recorded_does_not_happen_and_people_are_told(tmp_path, capsys):
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


def test_a_run_whose_record_is_gone_cannot_be_repeated_and_a_wrong_event_is_named(tmp_path):
    record = Recording(rrd=False, tables=False)
    with Simulation(LOSSY, overrides=["duration_s=1"], out=tmp_path / "run", record=record) as simulation:
        simulation.apply_event(KILL)
        simulation.run()
    path = tmp_path / "run" / LIVE_EVENTS
    path.write_text(path.read_text().replace("flock-1", "nobody"))
    with pytest.raises(BadInput, match="event 0 .*robots.names: "):
        repeat(tmp_path / "run")
    path.unlink()
    with pytest.raises(BadInput, match=LIVE_EVENTS):
        repeat(tmp_path / "run")

"""Events as observers tell them."""

import numpy as np
import polars as pl

from swarmwire.comms.truth import Happened
from swarmwire.metrics.event_log import EventLog
from swarmwire.metrics.metrics import Metrics
from swarmwire.metrics.record.event_recorder import EventRecorder
from swarmwire.metrics.viewer.recording import RerunRecording
from tests.support.clocks import StillClock
from tests.support.metrics.truths import static, truth
from tests.unit.metrics.viewer.test_rerun_recording import column


def kill(*changed: bool, ended: bool = False) -> Happened:
    return Happened(0, 0.15, "kill", ended, np.array(changed))


def test_the_summary_names_the_robots_of_each_arena():
    log, of = EventLog(), static(2, arenas=2)
    log.begin(of)
    log.see(truth(of, 1))
    log.see(truth(of, 2, events=(kill(True, False, True, True), kill(False, True, False, False, ended=True))))
    first, second = log.end(None)["events"]
    robots = [["flock-0"], ["flock-0", "flock-1"]]
    expected = {"at_s": 0.15, "tick": 2, "do": "kill", "part": "", "ended": False, "singly": False, "robots": robots}
    assert first == expected
    assert (second["ended"], second["robots"]) == (True, [["flock-1"], []])


def broken(*changed: bool) -> Happened:
    return Happened(1, 0.2, "fail", False, np.array(changed), "motors", singly=True)


def test_what_failed_is_told_with_its_part():
    log, of = EventLog(), static(2)
    log.begin(of)
    log.see(truth(of, 2, events=(broken(True, False),)))
    (told,) = log.end(None)["events"]
    assert (told["do"], told["part"], told["singly"]) == ("fail", "motors", True)
    assert [event.words for event in (broken(True, True), kill(True, ended=True))] == ["fail motors", "kill ended"]


def test_what_happens_singly_has_rows_of_those_arenas_alone_in_which_somebody_changed(tmp_path):
    of, recorder = static(2, arenas=2), EventRecorder(tmp_path)
    recorder.begin(of)
    recorder.see(truth(of, 2, events=(broken(False, False, False, True), kill(True, False, False, False))))
    assert recorder.end(None)["record_events"]["rows"] == 3
    rows = pl.read_parquet(tmp_path / "events.parquet").select("do", "part", "arena", "robots").rows()
    assert rows == [("fail", "motors", 1, ["flock-1"]), ("kill", "", 0, ["flock-0"]), ("kill", "", 1, [])]


def test_a_recording_says_what_happened_in_its_arena(tmp_path):
    of, metrics = static(2, arenas=2), Metrics()
    recording = RerunRecording(tmp_path / "run.rrd", metrics, StillClock(), arena=1)
    metrics.begin(of)
    recording.begin(of)
    elsewhere, here = broken(True, True, False, False), broken(False, False, True, False)
    happened = truth(of, 1, events=(kill(True, False, True, True), elsewhere)), truth(of, 2, events=(here, elsewhere))
    for one in (truth(of), *happened):
        metrics.see(one)
        recording.see(one)
    recording.end(None)
    texts = column(tmp_path / "run.rrd", "/events", "TextLog:text")
    assert (texts[1], texts[2]) == (["kill: flock-0, flock-1"], ["fail motors: flock-0"])

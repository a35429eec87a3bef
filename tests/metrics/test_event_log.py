"""Events as observers tell them."""

import numpy as np

from swarmwire.comms.truth import Happened
from swarmwire.metrics.event_log import EventLog
from swarmwire.metrics.metrics import Metrics
from swarmwire.metrics.rerun_recording import RerunRecording
from tests.metrics.test_rerun_recording import column
from tests.metrics.truths import static, truth


def kill(*changed: bool, ended: bool = False) -> Happened:
    return Happened(0, 0.15, "kill", ended, np.array(changed))


def test_the_summary_names_the_robots_of_each_arena():
    log, of = EventLog(), static(2, arenas=2)
    log.begin(of)
    log.see(truth(of, 1))
    log.see(truth(of, 2, events=(kill(True, False, True, True), kill(False, True, False, False, ended=True))))
    first, second = log.end(None)["events"]
    robots = [["flock-0"], ["flock-0", "flock-1"]]
    assert first == {"at_s": 0.15, "tick": 2, "do": "kill", "ended": False, "robots": robots}
    assert (second["ended"], second["robots"]) == (True, [["flock-1"], []])


def test_a_recording_says_what_happened_in_its_arena(tmp_path):
    of, metrics = static(2, arenas=2), Metrics()
    recording = RerunRecording(tmp_path / "run.rrd", metrics, arena=1)
    metrics.begin(of)
    recording.begin(of)
    for one in (truth(of), truth(of, 1, events=(kill(True, False, True, True),))):
        metrics.see(one)
        recording.see(one)
    recording.end(None)
    assert column(tmp_path / "run.rrd", "/events", "TextLog:text")[1] == ["kill: flock-0, flock-1"]

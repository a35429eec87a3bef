"""The recording of a run holds what the run itself says."""

import numpy as np
import pytest

from swarmwire.comms.interfaces import Observer
from swarmwire.comms.packets import FATE_NAMES, Fate
from swarmwire.deploy import run
from tests.integration.metrics.viewer.test_recording import class_names, column, series
from tests.support.deploy.commands import LOSSY

pytest.importorskip("rerun", reason="needs the extra [view]")

DURATION_S, RATE_HZ = 8, 10


class Seen(Observer):
    """Observer that keeps every tick."""

    def __init__(self):
        self.ticks = []

    def see(self, truth):
        self.ticks.append(truth)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A run of a flock in which a fifth dies after 4 s: its recording, its result and its ticks."""
    out, seen = tmp_path_factory.mktemp("runs") / "run", Seen()
    event = 'events=[{at_s=4.0,do="kill",robots={group="flock",share=0.2}}]'
    result = run(LOSSY, overrides=[f"duration_s={DURATION_S}", event], out=out, observers=[seen])
    return out / "run.rrd", result, seen.ticks


def test_positions_and_who_is_dead_are_the_runs(recorded):
    rrd, _, ticks = recorded
    positions = column(rrd, "/world/robots", "Points2D:positions")
    assert list(positions) == list(range(DURATION_S * RATE_HZ))
    for seen in ticks:
        assert positions[seen.tick] == seen.pose[:, :2].astype(np.float32).tolist()
    names, classes = class_names(rrd), column(rrd, "/world/robots", "Points2D:class_ids")
    dead = {tick: sum(names[one][0] == "dead" for one in row) for tick, row in classes.items()}
    assert dead == {0: 0, 40: 4}


def test_fates_are_the_runs_own_tally(recorded):
    rrd, result, ticks = recorded
    drawn = series(rrd, "packets")
    seconds = range(RATE_HZ - 1, len(ticks), RATE_HZ)  # each shows the second that ends with it
    for name, values in drawn.items():
        fate = FATE_NAMES.index(name.replace(" ", "_"))
        assert sum(values.get(tick, 0.0) for tick in seconds) == sum(int(seen.tally.fates[0, fate]) for seen in ticks)
    received = sum(drawn["received"][tick] for tick in seconds)
    assert received == result.radio.fates["received"]
    listed = {name for name, count in result.radio.fates.items() if count and name not in ("in_flight", "out_of_range")}
    assert {name.replace(" ", "_") for name in drawn} == listed


def test_lines_of_lost_packets_are_those_that_the_radio_finished(recorded):
    rrd, _, ticks = recorded
    lines = column(rrd, "/world/lost_packets", "LineStrips2D:strips")
    for seen in ticks:
        unheard = (seen.finished.fate != Fate.RECEIVED) & (seen.finished.receiver >= 0)
        assert len(lines.get(seen.tick, [])) == unheard.sum()
    assert any(lines.values())


def test_metrics_end_where_the_summary_says(recorded):
    rrd, result, ticks = recorded
    drawn = {name: of for plot in ("shares", "distances", "numbers") for name, of in series(rrd, plot).items()}
    for name in ("order", "components", "collisions", "min_gap", "largest_component"):
        assert drawn[name][len(ticks) - 1] == pytest.approx(result.metrics[name].final)
    order = list(drawn["order"].values())
    assert np.mean(order) == pytest.approx(result.metrics["order"].mean)


def test_events_name_the_robots_of_the_summary(recorded):
    rrd, result, _ = recorded
    [event] = result.events
    told = column(rrd, "/events", "TextLog:text")
    assert told[event.tick] == [f"kill: {', '.join(event.robots[0])}"]

from pathlib import Path

import numpy as np
import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.comms.fates import Fate
from swarmwire.comms.truth import Light, Obstacle
from swarmwire.metrics.metrics import Metrics
from swarmwire.metrics.rerun_recording import RerunRecording
from tests.metrics.truths import edges, static, tally, truth

rerun = pytest.importorskip("rerun", reason="needs the extra [view]")

OBSTACLES = (Obstacle("cylinder", 1.0, 1.0, radius_m=0.2), Obstacle("box", -1.0, 0.0, 0.5, size_m=(0.6, 0.2)))


@pytest.fixture(autouse=True)
def strict():
    """Rerun only warns of bad data unless it is told otherwise."""
    rerun.set_strict_mode(True)
    yield
    rerun.set_strict_mode(False)


def record(path: Path, of, ticks, arena=0):
    metrics = Metrics()
    recording = RerunRecording(path, metrics, arena)
    observers = (metrics, recording)
    for observer in observers:
        observer.begin(of)
    for seen in ticks:
        for observer in observers:
            observer.see(seen)
    assert recording.end(None) == {}


def moving(of, ticks, **fields):
    rng = np.random.default_rng(5)
    for tick in range(ticks):
        pose = rng.uniform(-3.0, 3.0, (of.arenas * of.robots, 3))
        yield truth(of, tick, pose=pose, **fields)


def column(path, entity, component):
    """What was logged of a component, by tick (None: once for the run): an array per row."""
    found = {}
    for chunk in rerun.chunk.RrdReader(str(path)).stream().filter(content=entity):
        batch = chunk.to_record_batch()
        if component in batch.schema.names:
            ticks = batch["tick"].to_pylist() if "tick" in batch.schema.names else [None] * batch.num_rows
            rows = batch[component].to_pylist()
            found.update({tick: row for tick, row in zip(ticks, rows, strict=True) if row is not None})
    return dict(sorted(found.items(), key=lambda item: -1 if item[0] is None else item[0]))


@pytest.mark.parametrize("arena", [0, 1])
def test_a_recording_holds_the_positions_and_headings_of_its_arena(tmp_path, arena):
    of = static(3, arenas=2, obstacles=OBSTACLES)
    ticks = list(moving(of, 40, edges=edges((0, 1), (4, 5))))
    record(tmp_path / "run.rrd", of, ticks, arena)
    positions = column(tmp_path / "run.rrd", "/world/robots", "Points2D:positions")
    vectors = column(tmp_path / "run.rrd", "/world/headings", "Arrows2D:vectors")
    assert list(positions) == list(vectors) == list(range(40))
    for seen in ticks:
        pose = seen.pose[3 * arena : 3 * arena + 3]
        assert positions[seen.tick] == pose[:, :2].astype(np.float32).tolist()
        x, y = np.array(vectors[seen.tick]).T
        np.testing.assert_allclose(np.arctan2(y, x), pose[:, 2], atol=1e-5)


def test_links_join_the_positions_of_the_robots_that_an_edge_names(tmp_path):
    of = static(3, arenas=2)
    [seen] = moving(of, 1, edges=edges((0, 1), (3, 5)))
    record(tmp_path / "run.rrd", of, [seen], arena=1)
    strips = column(tmp_path / "run.rrd", "/world/links", "LineStrips2D:strips")
    assert strips == {0: [seen.pose[[3, 5], :2].astype(np.float32).tolist()]}


@pytest.mark.parametrize(("robots", "expected"), [(200, list(range(12))), (201, [0, 10])])
def test_links_of_large_swarms_are_thinned(tmp_path, robots, expected):
    of = static(robots)
    record(tmp_path / "run.rrd", of, moving(of, 12, edges=edges((0, 1))))
    assert list(column(tmp_path / "run.rrd", "/world/links", "LineStrips2D:strips")) == expected


def test_plots_hold_what_the_metrics_measured_and_the_delivery_of_the_last_second(tmp_path):
    of = static(4)
    before, after = tally({Fate.HEARD: 1, Fate.LOST: 3}), tally({Fate.HEARD: 4})
    fields = {"edges": edges((0, 1)), "contact_onsets": np.array([[1, 0]])}
    ticks = [truth(of, tick, tally=after if tick >= 10 else before, **fields) for tick in range(21)]
    record(tmp_path / "run.rrd", of, ticks)
    shares = column(tmp_path / "run.rrd", "/plots/shares", "Scalars:scalars")
    assert column(tmp_path / "run.rrd", "/plots/shares", "SeriesLines:names") == {
        None: ["order", "order_velocity", "largest_component", "unrejoined", "delivery"]
    }
    assert shares[0] == pytest.approx([1.0, 0.0, 0.5, np.nan, 0.25], nan_ok=True)
    assert shares[14] == pytest.approx([1.0, 0.0, 0.5, np.nan, (5 * 4 + 5 * 1) / 40], nan_ok=True)
    assert shares[20] == pytest.approx([1.0, 0.0, 0.5, np.nan, 1.0], nan_ok=True)
    assert column(tmp_path / "run.rrd", "/plots/packets", "Scalars:scalars")[20] == [40.0, 0.0]
    assert column(tmp_path / "run.rrd", "/plots/numbers", "Scalars:scalars")[20] == pytest.approx(
        [3.0, 0.0, np.nan, np.nan, 21.0, 0.0], nan_ok=True
    )
    assert column(tmp_path / "run.rrd", "/plots/distances", "SeriesLines:names") == {
        None: ["min_gap", "target_best", "target_mean"]
    }
    assert column(tmp_path / "run.rrd", "/plots/distances", "Scalars:scalars")[20][0] == pytest.approx(-0.07)


def test_the_dead_change_colour_and_back(tmp_path):
    of = static(2)
    alive = [np.array(state) for state in ([True, True], [True, False], [True, False], [True, True])]
    record(tmp_path / "run.rrd", of, [truth(of, tick, alive=state) for tick, state in enumerate(alive)])
    color = column(tmp_path / "run.rrd", "/world/robots", "Points2D:colors")
    assert list(color) == [0, 1, 3]
    assert color[0] == color[3]
    assert color[1][0] == color[0][0]
    assert color[1][1] != color[0][1]


def test_a_recording_has_no_wall_clock_time_and_equal_runs_have_equal_contents(tmp_path):
    of = static(3, obstacles=OBSTACLES)
    contents = []
    for path in (tmp_path / "a.rrd", tmp_path / "b.rrd"):
        record(path, of, moving(of, 5, edges=edges((0, 1)), tally=tally({Fate.HEARD: 2})))
        chunks = list(rerun.chunk.RrdReader(str(path)).stream())
        assert {name for chunk in chunks for name in chunk.timeline_names} == {"tick", "sim_time"}
        columns = {(chunk.entity_path, name) for chunk in chunks for name in chunk.to_record_batch().schema.names}
        logged = {key for key in columns if key[1] not in {"rerun.controls.RowId", "tick", "sim_time"}}
        contents.append({key: repr(column(path, *key)) for key in logged})  # NaN is no NaN's equal
    assert contents[0] == contents[1]
    assert len(contents[0]) > 20


def test_a_run_without_a_radio_has_no_links_and_no_plot_of_packets(tmp_path):
    of = static(3, radio=False)
    record(tmp_path / "run.rrd", of, moving(of, 3))
    assert column(tmp_path / "run.rrd", "/world/links", "LineStrips2D:strips") == {}
    assert column(tmp_path / "run.rrd", "/plots/packets", "Scalars:scalars") == {}
    assert column(tmp_path / "run.rrd", "/plots/shares", "SeriesLines:names") == {
        None: ["order", "order_velocity", "largest_component", "unrejoined"]
    }


def test_obstacles_and_lights_are_drawn_once_where_they_are(tmp_path):
    triangle = Obstacle("polygon", 1.0, -1.0, np.pi / 2, points_m=((0.0, 0.0), (1.0, 0.0), (0.0, 0.5)))
    of = static(2, obstacles=(*OBSTACLES, triangle), lights=((Light(0.5, -0.25, 2.0), Light(1.0, 1.5, 1.0)),))
    record(tmp_path / "run.rrd", of, moving(of, 2))
    (outlines,) = column(tmp_path / "run.rrd", "/world/obstacles", "LineStrips2D:strips").values()
    assert [len(outline) for outline in outlines] == [49, 5, 4]
    assert np.allclose(outlines[2], [[1.0, -1.0], [1.0, 0.0], [0.5, -1.0], [1.0, -1.0]], atol=1e-6)
    assert column(tmp_path / "run.rrd", "/world/lights", "Points2D:positions") == {None: [[0.5, -0.25], [1.0, 1.5]]}
    dark = static(2)
    record(tmp_path / "dark.rrd", dark, moving(dark, 2))
    assert column(tmp_path / "dark.rrd", "/world/lights", "Points2D:positions") == {}


def test_an_arena_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(BadInput, match=r"run\.rrd: arena: expected 0 to 1"):
        record(tmp_path / "run.rrd", static(2, arenas=2), [], arena=2)


def test_without_rerun_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr("swarmwire.metrics.view_extra.find_spec", lambda _: None)
    with pytest.raises(BadInput, match=r"run\.rrd: needs rerun-sdk: install swarmwire-metrics\[view\]"):
        RerunRecording(tmp_path / "run.rrd", Metrics())

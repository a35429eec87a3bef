"""Recordings for the viewer, and pictures taken of them."""

import struct
from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.ethernet import FRAME_TAG
from swarmwire.comms.base.geometry.floor import Floor, Patch
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.observe.truth import EventRecord, Group, Light
from swarmwire.comms.radio.records import ReceptionRecords
from swarmwire.comms.robot.packets import Fate
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.pictures.drawing.canvas import FATE_COLORS
from swarmwire.metrics.pictures.viewer.recording import RerunRecording
from swarmwire.metrics.pictures.viewer.screenshot import NoGraphics, render_png
from swarmwire.metrics.pictures.viewer.style import DEAD, packed
from swarmwire.metrics.records.run_folder.table import TableState
from swarmwire.metrics.records.run_folder.verify import check_recording
from tests.support.clocks import StillClock
from tests.support.metrics.recordings import class_names, column, moving, record, series
from tests.support.metrics.truths import edges, static, tally, truth, watch
from tests.support.refusals import refused_input

rerun = pytest.importorskip("rerun", reason="needs the extra [view]")

OBSTACLES = (Obstacle("cylinder", 1.0, 1.0, radius_m=0.2), Obstacle("box", -1.0, 0.0, 0.5, size_m=(0.6, 0.2)))


@pytest.fixture(autouse=True)
def strict():
    """Rerun only warns of bad data unless it is told otherwise."""
    rerun.set_strict_mode(True)
    yield
    rerun.set_strict_mode(False)


def test_recording_holds_positions_and_headings_of_the_first_arena(tmp_path):
    run = static(3, arenas=2, obstacles=OBSTACLES)
    ticks = list(moving(run, 40, edges=edges((0, 1), (4, 5))))
    record(tmp_path / "run.rrd", run, ticks)
    positions = column(tmp_path / "run.rrd", "/world/robots", "Points2D:positions")
    vectors = column(tmp_path / "run.rrd", "/world/headings", "Arrows2D:vectors")
    assert list(positions) == list(vectors) == list(range(40))
    for moment in ticks:
        pose = moment.pose[:3]
        assert positions[moment.tick] == pose[:, :2].astype(np.float32).tolist()
        x, y = np.array(vectors[moment.tick]).T
        np.testing.assert_allclose(np.arctan2(y, x), pose[:, 2], atol=1e-5)


def test_lit_leds_are_drawn_where_they_sit_until_they_are_dark(tmp_path):
    run = static(2)
    leds = np.zeros((2, 8), np.int64)
    leds[1, 2] = 0x0080FF  # the one to the left
    pose = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, np.pi / 2]])
    dark = truth(run, 3, pose=pose), truth(run, 4, pose=pose)
    lit = truth(run, 1, pose=pose, leds=leds), truth(run, 2, pose=pose, leds=leds)
    record(tmp_path / "run.rrd", run, [truth(run, 0, pose=pose), *lit, *dark])
    positions = column(tmp_path / "run.rrd", "/world/leds", "Points2D:positions")
    np.testing.assert_allclose(positions.pop(1), [[1.0 - 0.042, 2.0]], atol=1e-6)
    np.testing.assert_allclose(positions.pop(2), [[1.0 - 0.042, 2.0]], atol=1e-6)
    assert positions == {3: []}
    assert column(tmp_path / "run.rrd", "/world/leds", "Points2D:colors")[1] == [0x0080FFFF]


def test_links_join_the_positions_of_the_robots_that_an_edge_names(tmp_path):
    run = static(3, arenas=2)
    [moment] = moving(run, 1, edges=edges((0, 2), (3, 4)))
    record(tmp_path / "run.rrd", run, [moment])
    strips = column(tmp_path / "run.rrd", "/world/links", "LineStrips2D:strips")
    assert strips == {0: [moment.pose[[0, 2], :2].astype(np.float32).tolist()]}


@pytest.mark.parametrize(("robots", "expected"), [(200, list(range(12))), (201, [0, 10])])
def test_links_of_large_swarms_are_thinned(tmp_path, robots, expected):
    run = static(robots)
    record(tmp_path / "run.rrd", run, moving(run, 12, edges=edges((0, 1))))
    assert list(column(tmp_path / "run.rrd", "/world/links", "LineStrips2D:strips")) == expected


def test_plots_hold_what_the_metrics_measured_in_each_tick(tmp_path):
    run, metrics = static(4), Metrics()
    expected = {metric.name: {} for metric in metrics.metrics}
    ticks = list(moving(run, 30, edges=edges((0, 1)), contact_onsets=np.array([[1, 0]])))
    metrics.begin(run)
    for moment in ticks:
        metrics.see(moment)
        for name, value in metrics.latest.items():
            expected[name][moment.tick] = value[0]
    record(tmp_path / "run.rrd", run, ticks)
    drawn = {}
    for plot in ("shares", "distances", "times", "numbers"):
        drawn |= series(tmp_path / "run.rrd", plot)
    valued = {name for name, values in expected.items() if not all(map(np.isnan, values.values()))}
    assert drawn.keys() == valued
    assert {"order", "components", "collisions", "min_gap"} <= valued
    assert not {"target_best", "rejoin_median"} & valued
    for name, values in drawn.items():
        assert values == {tick: pytest.approx(expected[name][tick], nan_ok=True) for tick in values}
        assert all(np.isnan(expected[name][tick]) for tick in expected[name].keys() - values.keys())


def test_packets_are_drawn_by_fate_as_receivers_per_second_once_a_fate_occurs(tmp_path):
    run = static(4)
    counts = [{Fate.RECEIVED: tick % 3, Fate.LOST: 2 if tick >= 12 else 0, Fate.OUT_OF_RANGE: 9} for tick in range(40)]
    record(tmp_path / "run.rrd", run, [truth(run, tick, tally=tally(count)) for tick, count in enumerate(counts)])
    drawn = series(tmp_path / "run.rrd", "packets")
    assert drawn.keys() == {"received", "lost"}
    assert min(drawn["lost"]) == 12
    for fate, name in ((Fate.RECEIVED, "received"), (Fate.LOST, "lost")):
        for tick, value in drawn[name].items():
            last = [count[fate] for count in counts[max(0, tick - 9) : tick + 1]]
            assert value == pytest.approx(10 * sum(last) / len(last))
    link_pdr = series(tmp_path / "run.rrd", "shares")["link_pdr"]
    received, in_range = (
        sum(sum(count[f] for f in fates) for count in counts[-10:])
        for fates in ([Fate.RECEIVED], [Fate.RECEIVED, Fate.LOST])
    )
    assert link_pdr[39] == pytest.approx(received / in_range)


def test_robots_are_told_apart_by_group_and_state_and_the_dead_are_grey(tmp_path):
    run = static(3)
    run = replace(run, groups=(replace(run.groups[0], stop=2), Group("b", run.groups[0].body, 2, 3)))
    states = ("", "search", "carry")
    alive = [[True, True, True], [True, True, True], [True, False, True], [True, True, True], [True, True, True]]
    at = [[0, 0, 0], [1, 0, 0], [1, 0, 2], [1, 1, 2], [1, 1, 2]]
    ticks = [
        truth(run, tick, alive=np.array(living), state=np.array(state), states=states)
        for tick, (living, state) in enumerate(zip(alive, at, strict=True))
    ]
    record(tmp_path / "run.rrd", run, ticks)
    named = class_names(tmp_path / "run.rrd")
    classes = column(tmp_path / "run.rrd", "/world/robots", "Points2D:class_ids")
    assert {tick: [named[one][0] for one in row] for tick, row in classes.items()} == {
        0: ["flock", "flock", "b"],
        1: ["flock: search", "flock", "b"],
        2: ["flock: search", "dead", "b: carry"],
        3: ["flock: search", "flock: search", "b: carry"],
    }
    for entity, archetype in (("robots", "Points2D"), ("headings", "Arrows2D")):
        colors = column(tmp_path / "run.rrd", f"/world/{entity}", f"{archetype}:colors")
        assert colors == {tick: [named[one][1] for one in row] for tick, row in classes.items()}
    # Rerun 0.41 forgets a constant annotation once another replaces it (AnnotationContextStoreSubscriber).
    assert list(column(tmp_path / "run.rrd", "/world", "AnnotationContext:context")) == [0, 1, 2]
    grey = named[0][1]
    assert grey == packed(DEAD, 255)
    assert len({color for _, color in named.values()}) == len(named)
    (legend,) = column(tmp_path / "run.rrd", "/legend", "Points2D:labels").values()
    (colors,) = column(tmp_path / "run.rrd", "/legend", "Points2D:colors").values()
    shown = dict(zip(legend, colors, strict=True))
    assert shown.pop("dead: crossed out") == grey
    assert {*shown.items(), ("dead", grey)} == set(named.values())


def test_dead_robots_are_crossed_out_where_they_are_until_they_live(tmp_path):
    run = static(2)
    pose = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 0.0]])
    lives = [[True, True], [True, False], [True, False], [False, False], [True, True], [True, True]]
    moments = [truth(run, tick, pose=pose, alive=np.array(alive)) for tick, alive in enumerate(lives)]
    record(tmp_path / "run.rrd", run, moments)
    crosses = column(tmp_path / "run.rrd", "/world/dead", "LineStrips2D:strips")
    assert {tick: len(strips) for tick, strips in crosses.items()} == {1: 2, 3: 4, 4: 0}
    for strip in crosses[1]:
        np.testing.assert_allclose(np.mean(strip, axis=0), [1.0, 2.0], atol=1e-6)
        assert np.ptp(strip, axis=0).min() > run.groups[0].body.radius_m


def test_keys_of_plots_name_each_line_in_its_colour(tmp_path):
    run = static(3)
    counts = tally({Fate.RECEIVED: 2, Fate.LOST: 1})
    record(tmp_path / "run.rrd", run, list(moving(run, 3, tally=counts)))
    (names,) = column(tmp_path / "run.rrd", "/keys/packets", "Points2D:labels").values()
    (colors,) = column(tmp_path / "run.rrd", "/keys/packets", "Points2D:colors").values()
    assert dict(zip(names, colors, strict=True)) == {
        "received": packed(FATE_COLORS[Fate.RECEIVED], 255),
        "lost": packed(FATE_COLORS[Fate.LOST], 255),
    }


def test_legend_counts_the_classes_it_omits_and_draws_any_letters(tmp_path):
    run, states = static(3), ("", "\u2192 caf\u00e9", *(f"state {i}" for i in range(20)))
    ticks = [truth(run, tick, state=np.full(3, tick + 1), states=states) for tick in range(10)]
    record(tmp_path / "run.rrd", run, ticks)
    (legend,) = column(tmp_path / "run.rrd", "/legend", "Points2D:labels").values()
    *shown, more = legend
    assert shown == ["? caf\u00e9", "state 0", "state 1", "state 2", "state 3"]
    assert "5" in more


def test_packets_that_ended_unheard_are_lines_in_the_colour_of_their_fate(tmp_path):
    run = static(3, arenas=2)
    own = ReceptionRecords(
        arena=np.array([0, 0, 0, 1, 0]),
        sender=np.array([0, 1, 2, 0, 0]),
        receiver=np.array([1, 2, 0, 1, -1]),
        receivers=np.array([1, 1, 1, 1, 2]),
        **dict.fromkeys(
            ("to", "sequence", "sent_at_ns", "on_air_at_ns", "final_at_ns", "size_bytes", "tag"), np.zeros(5, int)
        ),
        fate=np.array([Fate.LOST, Fate.RECEIVED, Fate.BLOCKED, Fate.LOST, Fate.QUEUE_FULL]),
    )
    first, second = moving(run, 2)
    record(tmp_path / "run.rrd", run, [replace(first, finished=own), second])
    lines = column(tmp_path / "run.rrd", "/world/lost_packets", "LineStrips2D:strips")
    position_m = first.pose[:3, :2].astype(np.float32)
    assert lines == {0: [position_m[[0, 1]].tolist(), position_m[[2, 0]].tolist()]}
    colors = column(tmp_path / "run.rrd", "/world/lost_packets", "LineStrips2D:colors")[0]
    assert [color >> 8 for color in colors] == [packed(FATE_COLORS[fate], 0) >> 8 for fate in (Fate.LOST, Fate.BLOCKED)]


def frames(*links, tag=FRAME_TAG):
    """Receptions, each as sender, receiver, bytes and fate; with another tag they are messages of agents."""
    sender, receiver, size_bytes, fate = np.array(links, np.int64).reshape(-1, 4).T
    zero = np.zeros(len(sender), int)
    return ReceptionRecords(
        zero, sender, receiver, zero + 1, zero, zero, zero, zero, zero, fate, size_bytes, zero + tag
    )


def test_links_that_carry_frames_of_interfaces_have_their_bytes_per_second_of_the_last_second(tmp_path):
    run = static(3, arenas=2)
    there_and_back = frames((0, 1, 300, Fate.RECEIVED), (1, 0, 200, Fate.RECEIVED), (2, 1, 900, Fate.LOST))
    ticks = list(moving(run, run.rate_hz + 2))
    ticks[0] = replace(ticks[0], finished=there_and_back)
    message = frames((0, 2, 300, Fate.RECEIVED), tag=7)
    ticks[1:] = [replace(moment, finished=message) for moment in ticks[1:]]
    record(tmp_path / "run.rrd", run, ticks)
    labels = column(tmp_path / "run.rrd", "/world/traffic", "LineStrips2D:labels")
    strips = column(tmp_path / "run.rrd", "/world/traffic", "LineStrips2D:strips")
    assert labels[0] == [f"{500 * run.rate_hz / 1000:.1f} kB/s"]
    assert labels[run.rate_hz - 1] == ["500 B/s"]
    assert labels[run.rate_hz] == strips[run.rate_hz] == []
    assert run.rate_hz + 1 not in labels
    assert strips[0] == [ticks[0].pose[[0, 1], :2].astype(np.float32).tolist()]


def test_events_of_the_first_arena_are_told_and_marked_where_they_take_effect(tmp_path):
    run = static(2, arenas=2)
    kill = EventRecord(0, 0.15, "kill", False, np.array([True, True, True, False]))
    elsewhere, local = (
        EventRecord(1, 0.2, "fail", False, np.array(changed), "motors", singly=True)
        for changed in ([False, False, True, True], [True, False, False, False])
    )
    happened = truth(run, 1, events=(kill, elsewhere)), truth(run, 3, events=(local, elsewhere))
    record(tmp_path / "run.rrd", run, [truth(run), happened[0], truth(run, 2), happened[1]])
    texts = column(tmp_path / "run.rrd", "/events", "TextLog:text")
    assert "2 robots" in texts[0][0]
    assert (texts[1], texts[3], len(texts)) == (["kill: flock-0, flock-1"], ["fail motors: flock-0"], 3)
    assert list(column(tmp_path / "run.rrd", "/plots/shares/event", "Scalars:scalars")) == [1, 3]


def test_recording_sends_each_entity_once_per_two_seconds(tmp_path, monkeypatch):
    calls = []
    for name in ("log", "send_columns"):
        original = getattr(rerun.RecordingStream, name)
        monkeypatch.setattr(
            rerun.RecordingStream,
            name,
            lambda *args, original=original, **more: (calls.append(args[1]), original(*args, **more)),
        )
    run, metrics, clock = static(150), Metrics(), StillClock()
    recording = RerunRecording(tmp_path / "run.rrd", metrics, clock)
    for observer in (metrics, recording):
        observer.begin(run)
    sent = []
    for moment in moving(run, 9, edges=edges((0, 1), (1, 2)), tally=tally({Fate.RECEIVED: 150})):
        calls.clear()
        clock.time_ns += 7 * NS_PER_S // 10
        for observer in (metrics, recording):
            observer.see(moment)
        sent.append([call for call in calls if call.startswith("world/")])
    assert [bool(names) for names in sent] == [False, False, True] * 3
    assert set(sent[5]) == set(sent[8]) >= {"world/robots", "world/headings", "world/links", "world/selected"}
    assert len(set(sent[5])) == len(sent[5]) < 10
    recording.end(None)


def test_recording_sends_earlier_when_much_is_buffered(tmp_path, monkeypatch):
    monkeypatch.setattr("swarmwire.metrics.pictures.viewer.recording.RerunRecording._send_bytes", 10_000)
    record(tmp_path / "run.rrd", static(100), moving(static(100), 20))
    chunks = rerun.chunk.RrdReader(str(tmp_path / "run.rrd")).stream().filter(content="/world/headings")
    rows = [
        len(batch)
        for batch in (chunk.to_record_batch() for chunk in chunks)
        if "Arrows2D:vectors" in batch.schema.names
    ]
    assert sum(rows) == 20
    assert len(rows) > 3


def test_recording_is_closed_when_an_entity_fails_at_its_end(tmp_path, monkeypatch):
    run, metrics = static(3), Metrics()
    recording = RerunRecording(tmp_path / "run.rrd", metrics, StillClock())
    watch(run, moving(run, 4), metrics, recording)
    monkeypatch.setattr(rerun.TextLog, "columns", refuse)
    recording._rows.add("events", rerun.TextLog.columns, text=["cannot be sent"])
    with pytest.raises(ValueError, match="refused"):
        recording.end(None)
    assert check_recording(tmp_path / "run.rrd")[0] is TableState.INTACT
    assert list(column(tmp_path / "run.rrd", "/world/robots", "Points2D:positions")) == [0, 1, 2, 3]


def test_recording_that_failed_at_its_begin_is_closed(tmp_path, monkeypatch):
    recording = RerunRecording(tmp_path / "run.rrd", Metrics(), StillClock())
    monkeypatch.setattr("swarmwire.metrics.pictures.viewer.layout.about", refuse)
    with pytest.raises(ValueError, match="refused"):
        recording.begin(static(3))
    recording.end(None)
    state, text = check_recording(tmp_path / "run.rrd")
    assert state is TableState.PARTIAL
    assert "closed" not in text


def refuse(*_, **__):
    raise ValueError("refused")


def view_names(path):
    [blueprint] = rerun.chunk.RrdReader(str(path)).blueprints()
    batches = [chunk.to_record_batch() for chunk in rerun.chunk.RrdReader(str(path)).stream(store=blueprint)]
    names = "ViewBlueprint:display_name"
    return {name for batch in batches if names in batch.schema.names for [name] in batch[names].to_pylist()}


@pytest.mark.parametrize(("radio", "size_m"), [(True, (8.0, 6.0)), (True, (2.0, 9.0)), (False, (8.0, 6.0))])
def test_recording_opens_with_named_views_of_its_contents(tmp_path, radio, size_m):
    run = replace(static(2, radio=radio), arena_size_m=size_m)
    record(tmp_path / "run.rrd", run, moving(run, 1))
    names = view_names(tmp_path / "run.rrd")
    assert "Selected robot" in names
    assert len(names) == (17 if radio else 11)  # each plot has a view with the names of its lines


def test_recording_has_no_wall_clock_and_is_equal_for_equal_runs(tmp_path):
    run = static(3, obstacles=OBSTACLES)
    contents = []
    for path in (tmp_path / "a.rrd", tmp_path / "b.rrd"):
        record(path, run, moving(run, 5, edges=edges((0, 1)), tally=tally({Fate.RECEIVED: 2})))
        chunks = list(rerun.chunk.RrdReader(str(path)).stream())
        assert {name for chunk in chunks for name in chunk.timeline_names} == {"tick", "sim_time"}
        columns = {(chunk.entity_path, name) for chunk in chunks for name in chunk.to_record_batch().schema.names}
        logged = {key for key in columns if key[1] not in {"rerun.controls.RowId", "tick", "sim_time"}}
        contents.append({key: repr(column(path, *key)) for key in logged})  # NaN is no NaN's equal
    assert contents[0] == contents[1]
    assert len(contents[0]) > 20


def test_recording_without_a_radio_has_neither_links_nor_packets(tmp_path):
    run = static(3, radio=False)
    record(tmp_path / "run.rrd", run, moving(run, 3))
    assert column(tmp_path / "run.rrd", "/world/links", "LineStrips2D:strips") == {}
    assert column(tmp_path / "run.rrd", "/world/lost_packets", "LineStrips2D:strips") == {}
    assert series(tmp_path / "run.rrd", "packets") == {}
    assert series(tmp_path / "run.rrd", "shares").keys() == {"order", "order_velocity"}


def test_obstacles_and_lights_are_drawn_once_where_they_are(tmp_path):
    triangle = Obstacle("polygon", 1.0, -1.0, np.pi / 2, points_m=((0.0, 0.0), (1.0, 0.0), (0.0, 0.5)))
    run = static(2, obstacles=(*OBSTACLES, triangle), lights=((Light(0.5, -0.25, 2.0), Light(1.0, 1.5, 1.0)),))
    record(tmp_path / "run.rrd", run, moving(run, 2))
    (outlines,) = column(tmp_path / "run.rrd", "/world/obstacles", "LineStrips2D:strips").values()
    assert [len(outline) for outline in outlines] == [49, 5, 4]
    assert np.allclose(outlines[2], [[1.0, -1.0], [1.0, 0.0], [0.5, -1.0], [1.0, -1.0]], atol=1e-6)
    assert column(tmp_path / "run.rrd", "/world/lights", "Points2D:positions") == {None: [[0.5, -0.25], [1.0, 1.5]]}
    dark = static(2)
    record(tmp_path / "dark.rrd", dark, moving(dark, 2))
    assert column(tmp_path / "dark.rrd", "/world/lights", "Points2D:positions") == {}


def test_movable_obstacles_are_drawn_where_they_are_in_each_tick(tmp_path):
    pushed = Obstacle("box", 0.0, 0.0, size_m=(2.0, 1.0), mass_kg=1.0)
    run = static(2, obstacles=(*OBSTACLES, pushed))
    ticks = (truth(run, tick, movable=np.array([[[tick, 1.0, tick * np.pi / 2]]])) for tick in range(2))
    record(tmp_path / "run.rrd", run, ticks)
    (fixed,) = column(tmp_path / "run.rrd", "/world/obstacles", "LineStrips2D:strips").values()
    assert len(fixed) == len(OBSTACLES)
    lines = column(tmp_path / "run.rrd", "/world/movable", "LineStrips2D:strips")
    assert np.allclose(lines[0], [[[-1.0, 0.5], [1.0, 0.5], [1.0, 1.5], [-1.0, 1.5], [-1.0, 0.5]]])
    assert np.allclose(lines[1], [[[1.5, 0.0], [1.5, 2.0], [0.5, 2.0], [0.5, 0.0], [1.5, 0.0]]])


def test_floor_is_one_picture_in_a_recording(tmp_path):
    run = replace(static(2), floor=Floor(1.0, (Patch("disc", 4.0, 3.0, 0.0, radius_m=1.0),)))
    record(tmp_path / "run.rrd", run, moving(run, 2))
    (buffer,) = column(tmp_path / "run.rrd", "/world/floor", "Image:buffer").values()
    grey = np.array(buffer).reshape(384, 512)
    assert (grey[0, 0], grey[-1, -1], grey.min(), grey.max()) == (90, 30, 30, 90)  # the first row is the lowest
    assert np.mean(grey == 30) == pytest.approx(np.pi / 4 / 48, rel=0.02)
    bare = static(2)
    record(tmp_path / "bare.rrd", bare, moving(bare, 2))
    assert column(tmp_path / "bare.rrd", "/world/floor", "Image:buffer") == {}


def test_without_rerun_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr("swarmwire.comms.base.extras.find_spec", lambda _: None)
    with pytest.raises(BadInput, match=r"run\.rrd: .*swarmwire\[view\]"):
        RerunRecording(tmp_path / "run.rrd", Metrics(), StillClock())


def test_recording_without_room_fails_at_once_and_leaves_no_file(tmp_path):
    resource = pytest.importorskip("resource", reason="needs limits as Unix has them")
    recording = RerunRecording(tmp_path / "run.rrd", Metrics(), StillClock())
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (25_000, before[1]))
    try:
        with pytest.raises(OSError, match="File too large"):
            recording.begin(static())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    recording.end(None)
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def rrd(tmp_path):
    run, metrics = static(3), Metrics()
    recording = RerunRecording(tmp_path / "run.rrd", metrics, StillClock())
    x_m = np.linspace(-2, 2, 3)
    poses = (np.column_stack([x_m, np.full(3, 0.1 * tick), np.zeros(3)]) for tick in range(20))
    watch(run, (truth(run, tick, pose=pose) for tick, pose in enumerate(poses)), metrics, recording)
    recording.end(None)
    return tmp_path / "run.rrd"


def picture(rrd, name, at_s=None):
    png = rrd.with_name(name)
    try:
        render_png(rrd, png, at_s, size=(640, 360))
    except NoGraphics as fault:
        pytest.skip(str(fault))
    return png.read_bytes()


def test_picture_of_a_recording_has_the_given_size_and_time(rrd):
    last_s = 19 / static(3).rate_hz
    first, last, end = picture(rrd, "0.png", 0.0), picture(rrd, "19.png", last_s), picture(rrd, "end.png")
    assert struct.unpack(">II", first[16:24]) == (640, 360)
    assert first != last
    assert last == end


def test_picture_without_a_graphics_driver_is_refused_with_the_remedy(rrd, monkeypatch):
    monkeypatch.setenv("VK_ICD_FILENAMES", "/dev/null")
    monkeypatch.setenv("VK_DRIVER_FILES", "/dev/null")
    with pytest.raises(NoGraphics, match="mesa-vulkan-drivers"):
        render_png(rrd, rrd.with_name("none.png"))


@pytest.mark.parametrize("tick", [-1, 20])
def test_picture_at_a_time_that_was_not_recorded_is_refused(rrd, tick):
    with refused_input("--at", match="recorded"):
        picture(rrd, "none.png", tick / static(3).rate_hz)


def test_picture_of_a_missing_recording_is_refused(tmp_path):
    with refused_input(tmp_path / "none.rrd"):
        render_png(tmp_path / "none.rrd", tmp_path / "none.png")


@pytest.mark.parametrize("name", ["x.txt", "x", "x.jpg"])
def test_picture_not_named_png_is_refused(rrd, name):
    with pytest.raises(BadInput, check=lambda error: error.where == str(rrd.with_name(name))):
        render_png(rrd, rrd.with_name(name))
    assert not rrd.with_name(name).exists()

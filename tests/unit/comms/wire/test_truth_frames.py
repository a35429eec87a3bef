"""What observers elsewhere get of a run comes over whole, and what contradicts itself is refused."""

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.base.geometry.floor import Floor, FloorImage, Patch, packed_image
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.observe.run_views import MetricSeries, ObservedRun, ObservedTick, static_of, truth_of
from swarmwire.comms.observe.truth import EventRecord, Group, Light, Static, Truth
from swarmwire.comms.radio.records import PacketCounts, ReceptionRecords, TransmissionRecords
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.comms.robot.packets import Fate
from swarmwire.comms.robot.tick_io import GroupReadings
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.observer_frames import (
    OBSERVED_VERSION,
    decode_scene,
    decode_truth,
    encode_scene,
    encode_truth,
)
from tests.support.comms.equality import equal

ROBOTS, ARENAS = 3, 2
NOT_SENT = ("rssi_dbm", "payload", "payloads")  # as columns of numbers
ROWS = ROBOTS * ARENAS
OBSTACLES = (
    Obstacle("box", 1.0, 0.5, 0.2, size_m=(1.0, 2.0), height_m=0.3),
    Obstacle("polygon", 0, 0, points_m=((0, 0), (1, 0))),
)
PATCHES = (Patch("disc", 1.0, 0.0, 0.5, 0.2), Patch("polygon", 0.0, 0.0, 0.1, points_m=((0, 0), (1, 0), (0, 1))))
FLOOR = Floor(0.9, PATCHES, packed_image(np.arange(6, dtype=np.uint8).reshape(2, 3)))
STATIC = Static(
    name="two groups",
    seeds=(4, 9),
    rate_hz=10,
    arena_size_m=(8.0, 6.0),
    boundary="walls",
    obstacles=(OBSTACLES, ()),
    groups=(Group("a", load_body("epuck"), 0, 2), Group("b", load_body("footbot"), 2, 3, act_every_ticks=5)),
    robot_names=("a-0", "a-1", "b-0"),
    range_m=2.0,
    lights=((Light(0.5, 0.5, 2.0),), ()),
    floor=FLOOR,
)
SCENE = ObservedRun(
    STATIC, (MetricSeries("order", "", (0.0, 1.0)), MetricSeries("min_gap", "m", (None, None))), STATIC.robot_names[1]
)
I64 = np.iinfo(np.int64)


def ints(*shape: int, least: int = I64.min, most: int = I64.max) -> st.SearchStrategy[Any]:
    return npst.arrays(np.int64, shape, elements=st.integers(least, most))


def floats(*shape: int) -> st.SearchStrategy[Any]:
    return npst.arrays(np.float64, shape)


@st.composite
def finished_(draw: st.DrawFn) -> ReceptionRecords:
    k = draw(st.integers(0, 4))
    bounds = {
        "arena": (0, ARENAS),
        "sender": (0, ROBOTS),
        "receiver": (-1, ROBOTS),
        "to": (-1, ROBOTS),
        "fate": (0, len(Fate)),
    }
    columns = {
        field.name: draw(ints(k, least=bounds[field.name][0], most=bounds[field.name][1] - 1))
        if field.name in bounds
        else draw(ints(k))
        for field in fields(ReceptionRecords)
        if field.name not in NOT_SENT
    }
    return ReceptionRecords(**columns, rssi_dbm=draw(st.none() | floats(k)))


@st.composite
def glimpses(draw: st.DrawFn) -> ObservedTick:
    states = ("", *draw(st.lists(st.text(max_size=64), max_size=3)))
    rows = np.array(draw(st.lists(st.integers(0, ROWS - 1), unique=True)), np.int64)
    readings = {"a": GroupReadings(np.sort(rows), {"compass.heading_rad": draw(floats(len(rows)))})}
    flags = npst.arrays(np.bool_, ROWS)
    happened = st.builds(
        EventRecord,
        st.integers(0, 99),
        st.floats(0, 1e9),
        st.text(max_size=9),
        st.booleans(),
        flags,
        st.text(max_size=9),
        st.booleans(),
    )
    truth = Truth(
        tick=draw(st.integers(0, 2**40)),
        time_ns=draw(st.integers(0, 2**62)),
        running=np.ones(STATIC.arenas, np.bool_),
        alive=draw(flags),
        pose=draw(floats(ROWS, 3)),
        velocity=draw(floats(ROWS, 3)),
        command=draw(floats(ROWS, 3)),
        state=draw(ints(ROWS, least=0, most=len(states) - 1)),
        states=states,
        leds=draw(ints(ROWS, SCENE.static.max_leds, least=0, most=0xFFFFFF)),
        readings=draw(st.sampled_from([{}, readings])),
        contact_onsets=draw(ints(ARENAS, 2)),
        edges=draw(st.none() | ints(draw(st.integers(0, 5)), 2, least=0, most=ROWS - 1)),
        tally=draw(st.none() | st.builds(PacketCounts, ints(2), ints(2), ints(2), ints(2, len(Fate)))),
        finished=draw(st.none() | finished_()),
        events=tuple(draw(st.lists(happened, max_size=3))),
    )
    return ObservedTick(truth, draw(st.integers(0, 2**40)), draw(st.integers(1, 2**40)), draw(floats(2, ARENAS)))


@given(glimpses())
def test_truth_frame_survives_encoding(glimpse):
    assert equal(decode_truth(frames.decode(encode_truth(glimpse)), SCENE), glimpse)


def test_scene_and_truth_survive_with_movable_obstacles():
    box = Obstacle("box", 0.0, 0.0, size_m=(0.2, 0.2), mass_kg=0.5)
    scene = replace(SCENE, static=replace(STATIC, obstacles=((*OBSTACLES, box), (box,))))
    assert decode_scene(frames.decode(encode_scene(scene))) == scene
    glimpse = quiet(movable=np.arange(6.0).reshape(2, 1, 3))
    assert equal(decode_truth(frames.decode(encode_truth(glimpse)), scene), glimpse)
    with pytest.raises(BadFrame, match="movable"):
        decode_truth(frames.decode(encode_truth(quiet())), scene)
    uneven = replace(SCENE, static=replace(STATIC, obstacles=((*OBSTACLES, box), ())))
    with pytest.raises(BadFrame, match="equal numbers of movable ones"):
        decode_scene(frames.decode(encode_scene(uneven)))


def test_scene_survives_encoding_without_a_tick():
    frame = frames.decode(encode_scene(SCENE))
    assert decode_scene(frame) == SCENE
    assert (frame.kind, frame.tick) == ("scene", -1)


def quiet(**changes: Any) -> ObservedTick:
    truth = Truth(
        tick=1,
        time_ns=0,
        running=np.ones(STATIC.arenas, np.bool_),
        alive=np.ones(ROWS, np.bool_),
        pose=np.zeros((ROWS, 3)),
        velocity=np.zeros((ROWS, 3)),
        command=np.zeros((ROWS, 3)),
        state=np.zeros(ROWS, np.int64),
        states=("",),
        leds=np.zeros((ROWS, SCENE.static.max_leds), np.int64),
        readings={},
        contact_onsets=np.zeros((ARENAS, 2), np.int64),
        edges=None,
        tally=None,
        finished=None,
    )
    return ObservedTick(replace(truth, **changes), 0, 1, np.zeros((2, ARENAS)))


def single_reception(**changes: int) -> ReceptionRecords:
    names = [field.name for field in fields(ReceptionRecords) if field.name not in NOT_SENT]
    return ReceptionRecords(**{name: np.array([changes.get(name, 0)]) for name in names})


@pytest.mark.parametrize(
    ("fault", "changes"),
    [
        ("alive", {"alive": np.ones(ROWS - 1, np.bool_)}),
        ("pose", {"pose": np.zeros((ROWS, 2))}),
        ("velocity", {"velocity": np.zeros((ROWS, 3), np.int64)}),
        ("leds", {"leds": np.zeros((ROWS, SCENE.static.max_leds + 1), np.int64)}),
        ("leds", {"leds": np.full((ROWS, SCENE.static.max_leds), -1)}),
        ("leds", {"leds": np.full((ROWS, SCENE.static.max_leds), 0x1000000)}),
        ("state: expected 0 to 0$", {"state": np.full(ROWS, 1)}),
        ("state", {"state": np.full(ROWS, -1)}),
        ("states", {"states": ()}),
        ("states", {"states": ("", "x" * 65)}),
        ("edges", {"edges": np.array([[0, ROWS]])}),
        ("edges", {"edges": np.array([[-1, 0]])}),
        ("tick", {"tick": -1}),
        ("time_ns", {"time_ns": -1}),
        ("tally/fates", {"tally": PacketCounts(*np.zeros((3, ARENAS), np.int64), np.zeros((ARENAS, 3), np.int64))}),
        ("finished.fate", {"finished": single_reception(fate=len(Fate))}),
        ("finished.receiver", {"finished": single_reception(receiver=-2)}),
        ("finished.to: expected -1 to 2$", {"finished": single_reception(to=-2)}),
        ("finished.sender", {"finished": single_reception(sender=ROBOTS)}),
        ("events", {"events": (EventRecord(0, 0.0, "kill", False, np.ones(2, np.bool_)),)}),
        ("groups of this run", {"readings": {"c": GroupReadings(np.zeros(1, np.int64), {})}}),
        ("readings/a/rows", {"readings": {"a": GroupReadings(np.array([ROWS]), {"x": np.zeros(1)})}}),
        ("readings/a", {"readings": {"a": GroupReadings(np.array([0]), {"x": np.zeros(2)})}}),
    ],
)
def test_truth_frame_that_contradicts_itself_is_refused(fault, changes):
    with pytest.raises(BadFrame, match=fault):
        decode_truth(frames.decode(encode_truth(quiet(**changes))), SCENE)


EVENT = [0, 0.0, "kill", False, "", False]
WRONG_EVENTS = [7, [], EVENT[:5], [*EVENT, 0], [0, "0", *EVENT[2:]], [*EVENT[:5], 1], [*EVENT[:3], 1, *EVENT[4:]]]


@pytest.mark.parametrize("events", [None, {}, "kill", *([wrong] for wrong in WRONG_EVENTS)], ids=str)
def test_truth_frame_events_of_another_form_are_refused(events):
    frame = frames.decode(encode_truth(quiet(events=(EventRecord(0, 0.0, "kill", False, np.ones(ROWS, np.bool_)),))))
    assert frame.values["events"] == [EVENT]
    with pytest.raises(BadFrame, match="^malformed: events.*: expected"):
        decode_truth(replace(frame, values={**frame.values, "events": events}), SCENE)


def test_truth_frame_accepts_sensor_names_with_slashes():
    glimpse = quiet(readings={"a": GroupReadings(np.array([0]), {"own/of/mine": np.zeros(1)})})
    assert equal(decode_truth(frames.decode(encode_truth(glimpse)), SCENE), glimpse)


@pytest.mark.parametrize("change", [{"serial": -1}, {"ticks": 0}, {"values": np.zeros((3, ARENAS))}])
def test_truth_frame_numbers_are_checked(change):
    with pytest.raises(BadFrame):
        decode_truth(frames.decode(encode_truth(replace(quiet(), **change))), SCENE)


@pytest.mark.parametrize("version", [None, 0, 2, "1", True])
def test_observer_frame_of_another_version_is_refused(version):
    for kind, data in (("truth", encode_truth(quiet())), ("scene", encode_scene(SCENE))):
        frame = frames.decode(data)
        other = replace(frame, values={**frame.values, "version": version})
        with pytest.raises(BadFrame, match=f"expected {kind} {OBSERVED_VERSION}"):
            decode_truth(other, SCENE) if kind == "truth" else decode_scene(other)


def test_scene_of_a_run_at_the_lowest_rate_is_read():
    slow = replace(SCENE, static=replace(STATIC, rate_hz=1))
    assert decode_scene(frames.decode(encode_scene(slow))).static.rate_hz == 1


def test_observer_frame_of_another_kind_is_refused():
    with pytest.raises(BadFrame, match="expected truth"):
        decode_truth(frames.decode(encode_scene(SCENE)), SCENE)
    with pytest.raises(BadFrame, match="expected scene"):
        decode_scene(frames.decode(encode_truth(quiet())))


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"seeds": ()}, "seeds"),
        ({"rate_hz": 0}, "rate_hz"),
        ({"rate_hz": 10.5}, "scene.static.rate_hz"),
        ({"arena_size_m": (8.0, 0.0)}, "arena_size_m"),
        ({"arena_size_m": (8.0, float("nan"))}, r"scene.static.arena_size_m\[1\]"),
        ({"arena_size_m": (8.0, float("inf"))}, r"scene.static.arena_size_m\[1\]"),
        ({"boundary": "sea"}, "scene.static.boundary"),
        ({"floor": replace(FLOOR, image=FloorImage(2, 3, "AAAA"))}, "floor.image"),
        ({"floor": replace(FLOOR, image=replace(FLOOR.image, rows=3))}, "floor.image"),
        ({"floor": replace(FLOOR, image=replace(FLOOR.image, rows=-2))}, "floor.image"),
        ({"arena_size_m": (8.0,)}, "expected 2 values"),
        ({"obstacles": ((),)}, "obstacles"),
        ({"lights": ((),)}, "lights"),
        ({"robot_names": ("a-0", "a-1")}, "groups"),
        ({"robot_names": ("a-0", "a-1", 7)}, r"robot_names\[2\]"),
        ({"groups": (Group("b", load_body("footbot"), 1, 3),)}, "groups"),
        ({"groups": (Group("a", load_body("epuck"), 0, 0), Group("b", load_body("epuck"), 0, 3))}, "groups"),
        ({"name": ("two", "groups")}, "scene.static.name"),
        ({"groups": (Group("b", load_body("footbot"), 0, 3, act_every_ticks=0),)}, "act_every_ticks"),
    ],
)
def test_scene_that_contradicts_itself_is_refused(change, fault):
    with pytest.raises(BadFrame, match=fault):
        decode_scene(frames.decode(encode_scene(replace(SCENE, static=replace(STATIC, **change)))))


@pytest.mark.parametrize("parts", [{}, {"series": []}, {"static": None, "series": [], "selected": "", "more": 1}])
def test_scene_with_other_parts_is_refused(parts):
    with pytest.raises(BadFrame, match="scene: expected a map of static, series, selected"):
        decode_scene(frames.decode(frames.encode("scene", -1, {}, {"version": OBSERVED_VERSION, "scene": parts})))


@pytest.mark.parametrize(
    ("path", "value", "fault"),
    [
        ((), 7, "scene: expected a map"),
        (("more",), 7, "scene: expected a map"),
        (("static", "groups", 0), [], r"groups\[0\]: expected a map"),
        (("static", "groups", 0, "body"), 7, "body: expected a body"),
        (("static", "groups", 0, "body"), None, "body: expected a body"),
        (("static", "groups", 0, "body"), {"name": 7}, "body"),
        (("static", "groups", 0, "body", "radius_m"), -1.0, "radius_m"),
        (("static", "groups", 0, "body", "wings"), 2, "wings"),
        (("static", "obstacles", 0, 0, "height_m"), float("-inf"), "height_m"),
        (("static", "obstacles", 0, 0, "x_m"), float("inf"), "x_m"),
        (("static", "obstacles", 0, 0, "x_m"), "1", "x_m"),
        (("selected",), "nobody", "selected: expected one of the robots"),
    ],
)
def test_scene_with_a_wrong_value_is_refused(path, value, fault):
    frame = frames.decode(encode_scene(SCENE))
    values: dict[str, Any] = {"scene": None, **frame.values}
    inside: Any = values
    for step in ("scene", *path)[:-1]:
        inside = inside[step]
    inside[("scene", *path)[-1]] = value
    with pytest.raises(BadFrame, match=fault):
        decode_scene(replace(frame, values=values))


@pytest.mark.parametrize(
    "change",
    [{"lights": ()}, {"floor": replace(FLOOR, image=packed_image(np.zeros((1, 3), np.uint8)))}, {"floor": None}],
    ids=["no lights", "a row of grey", "no floor"],
)
def test_scene_with_few_parts_survives(change):
    scene = replace(SCENE, static=replace(STATIC, **change))
    assert decode_scene(frames.decode(encode_scene(scene))) == scene


@given(st.recursive(st.none() | st.booleans() | st.integers(0, 9) | st.text(max_size=3), st.lists))
def test_scene_of_anything_else_is_refused(junk):
    for scene in (junk, {"static": junk, "series": []}):
        with pytest.raises(BadFrame):
            decode_scene(frames.decode(frames.encode("scene", -1, {}, {"version": OBSERVED_VERSION, "scene": scene})))


@given(glimpses(), st.integers(0, ARENAS - 1))
@settings(max_examples=20)
def test_arena_of_several_is_a_run_of_its_own(glimpse, arena):
    truth, rows = replace(glimpse.truth, value=np.arange(ROWS) / 2), slice(arena * ROBOTS, (arena + 1) * ROBOTS)
    if truth.edges is not None:  # no edge joins robots of different arenas
        truth = replace(truth, edges=truth.edges[truth.edges[:, 0] // ROBOTS == truth.edges[:, 1] // ROBOTS])
    part = truth_of(truth, STATIC, arena)
    scene = ObservedRun(static_of(STATIC, arena), SCENE.series, SCENE.selected)
    values = glimpse.values[:, arena : arena + 1]
    decoded = decode_truth(frames.decode(encode_truth(replace(glimpse, truth=part, values=values))), scene)
    assert equal(decoded.truth.pose, truth.pose[rows])
    assert equal(part.value, truth.value[rows])
    assert decoded.truth.value is None  # it is not sent
    if truth.edges is not None:
        assert (part.edges + rows.start).tolist() == [e for e in truth.edges.tolist() if e[0] // ROBOTS == arena]
    if truth.finished is not None and part.finished is not None:
        assert len(part.finished.fate) == np.count_nonzero(truth.finished.arena == arena)
    sensor_rows = [row for group in part.readings.values() for row in (group.rows + rows.start).tolist()]
    assert sensor_rows == [row for g in truth.readings.values() for row in g.rows.tolist() if row // ROBOTS == arena]


def test_departed_packets_are_split_by_arena():
    numbers = {field.name: np.arange(4) for field in fields(TransmissionRecords)}
    packets = TransmissionRecords(**{**numbers, "arena": np.array([1, 0, 1, 0])})
    part = truth_of(replace(quiet().truth, departed=packets), STATIC, 1).departed
    assert part is not None
    assert part.sender.tolist() == [0, 2]
    assert part.arena.tolist() == [0, 0]


def test_single_arena_is_the_same_run():
    alone = static_of(STATIC, 0)
    truth = truth_of(quiet().truth, STATIC, 0)
    assert truth_of(truth, alone, 0) is truth

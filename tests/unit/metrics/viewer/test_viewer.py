"""What the viewer is sent: rows that wait, and the robot that a recording shows in detail."""

from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.observe.truth import Group
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.comms.robot.tick_io import GroupReadings
from swarmwire.metrics.pictures.viewer.layout import about
from swarmwire.metrics.pictures.viewer.rows import ROW_BYTES, RerunRows
from swarmwire.metrics.pictures.viewer.selection import living_robot, selected_robot
from tests.support.metrics.recordings import column, record
from tests.support.metrics.truths import static, truth

pytest.importorskip("rerun", reason="needs the extra [view]")
EPUCK = load_body("epuck")
assert EPUCK.proximity is not None
RESPONSE = EPUCK.proximity.response
LOOKS = np.deg2rad([17, 50, 90, 150, 210, 270, 310, 343])


def rays(path):
    strips = column(path, "/world/selected/rays", "LineStrips2D:strips")
    colors = column(path, "/world/selected/rays", "LineStrips2D:colors")
    return {tick: (np.array(lines), colors[tick]) for tick, lines in strips.items()}


def sensed(rows, **fields):
    return {
        "flock": GroupReadings(np.array(rows), {name.replace("_", ".", 1): value for name, value in fields.items()})
    }


def test_rays_leave_the_rim_where_the_sensors_look_and_end_where_they_read(tmp_path):
    run, distance_m = static(2, arenas=2), np.array([0.0, 0.01, 0.02, 0.03, 0.04, 0.05, 0.05, 0.05])
    value = np.zeros((2, 8))
    value[1] = RESPONSE.value(distance_m)
    pose = np.array([[9, 9, 0], [1.0, 2.0, 0.5], [0, 0, 0], [0, 0, 0]])
    tick = truth(run, pose=pose, readings=sensed([0, 1], proximity_value=value))
    record(tmp_path / "run.rrd", run, [tick], selected="flock-1")
    lines, _ = rays(tmp_path / "run.rrd")[0]
    outwards = np.stack([np.cos(LOOKS + 0.5), np.sin(LOOKS + 0.5)], axis=1)
    read_m = np.where(value[1] > 0, distance_m, RESPONSE.reach_m)
    read_m[0] = RESPONSE.distance_m(value[1, :1])[0]  # its answer is cut off at 1
    np.testing.assert_allclose(lines[:, 0], EPUCK.radius_m * outwards, atol=1e-6)
    np.testing.assert_allclose(lines[:, 1], (EPUCK.radius_m + read_m)[:, None] * outwards, atol=1e-4)
    moved = column(tmp_path / "run.rrd", "/world/selected", "Transform3D:translation")
    assert moved == {0: [[1.0, 2.0, 0.0]]}


def test_ray_has_the_colour_of_its_obstacle_and_noise_counts_as_none(tmp_path):
    run = static(2)
    pose = np.array([[0, 0, 0], [0.0, 0.09, 0]])  # the other stands on the ray to the left
    value = np.array([[0.5, 0.04, 0.5, 0, 0, 0, 0, 0], [0] * 8], float)
    record(tmp_path / "run.rrd", run, [truth(run, pose=pose, readings=sensed([0, 1], proximity_value=value))])
    _, colors = rays(tmp_path / "run.rrd")[0]
    wall, noise, robot, *nothing = colors
    assert len({wall, noise, robot}) == 3
    assert set(nothing) == {noise}


def test_between_its_turns_it_keeps_what_it_sensed_and_the_dead_sense_nothing(tmp_path):
    run, value = static(1), np.full((1, 8), 0.5)
    turned = np.array([[0.0, 0.0, 1.0]])
    ticks = [
        truth(run, 0, readings=sensed([0], proximity_value=value)),
        truth(run, 1, pose=turned),
        truth(run, 2, alive=np.array([False])),
        truth(run, 3, alive=np.array([False])),
    ]
    record(tmp_path / "run.rrd", run, ticks)
    drawn = rays(tmp_path / "run.rrd")
    assert {tick: len(lines) for tick, (lines, _) in drawn.items()} == {0: 8, 1: 8, 2: 0}
    turn = np.array([[np.cos(1.0), np.sin(1.0)], [-np.sin(1.0), np.cos(1.0)]])
    np.testing.assert_allclose(drawn[1][0], drawn[0][0] @ turn, atol=1e-6)


@pytest.mark.parametrize(("robots", "expected"), [(200, list(range(12))), (201, [0, 4, 5, 10])])
def test_rays_that_see_nothing_are_thinned_in_large_swarms(tmp_path, robots, expected):
    run = static(robots)
    ticks = [
        truth(run, tick, readings=sensed([0], proximity_value=np.full((1, 8), 0.5 if tick == 4 else 0.0)))
        for tick in range(12)
    ]
    record(tmp_path / "run.rrd", run, ticks)
    assert list(rays(tmp_path / "run.rrd")) == expected


def test_photocells_are_bars_as_long_as_what_they_see(tmp_path):
    run, value = static(1), np.linspace(0.0, 1.0, 8)[None]
    record(tmp_path / "run.rrd", run, [truth(run, readings=sensed([0], light_value=value))])
    lines, _ = rays(tmp_path / "run.rrd")[0]
    length_m = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1)
    np.testing.assert_allclose(length_m, 2.0 * EPUCK.radius_m * value[0], atol=1e-6)


def test_agent_that_senses_nothing_has_no_rays(tmp_path):
    run = static(2)
    record(tmp_path / "run.rrd", run, [truth(run, tick) for tick in range(3)])
    assert rays(tmp_path / "run.rrd") == {}


def test_selected_robot_is_the_first_with_rays_unless_named():
    blind = replace(EPUCK, sensors={})
    run = static(4)
    mixed = replace(run, groups=(Group("a", blind, 0, 2), Group("b", EPUCK, 2, 4)))
    assert selected_robot(mixed, None, "here") == "flock-2"
    assert selected_robot(replace(run, groups=(Group("a", blind, 0, 4),)), None, "here") == "flock-0"
    assert selected_robot(mixed, "flock-1", "here") == "flock-1"


def test_selected_robot_that_does_not_exist_is_refused(tmp_path):
    with pytest.raises(BadInput, check=lambda error: error.key == "selected" and "'nobody'" in error.expected):
        record(tmp_path / "run.rrd", static(2), [], selected="nobody")


def test_while_the_selected_robot_is_dead_the_next_one_alive_of_its_group_is_shown(tmp_path):
    run = static(3)
    pose = np.array([[0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0]])
    lives = [[True, True, True], [True, False, True], [True, False, False], [False, False, False], [True, True, True]]
    truths = [truth(run, tick, pose=pose, alive=np.array(alive)) for tick, alive in enumerate(lives)]
    record(tmp_path / "run.rrd", run, truths, selected="flock-1")
    moved = column(tmp_path / "run.rrd", "/world/selected", "Transform3D:translation")
    assert [row[0][0] for row in moved.values()] == [1.0, 2.0, 0.0, 1.0, 1.0]
    names = column(tmp_path / "run.rrd", "/world/selected/name", "Points2D:labels")
    assert names == {0: ["flock-1"], 1: ["flock-2"], 2: ["flock-0"], 3: ["flock-1"]}


def test_selected_dead_robot_is_replaced_only_within_its_group():
    mixed = replace(static(4), groups=(Group("a", EPUCK, 0, 2), Group("b", EPUCK, 2, 4)))
    assert living_robot(mixed, 1, np.array([False, False, True, True])) == 1
    assert living_robot(mixed, 3, np.array([True, True, True, False])) == 2


@pytest.mark.parametrize(
    ("body", "rays", "light"), [("epuck", True, True), ("kilobot", False, True), ("point", False, False)]
)
def test_rays_and_light_are_told_of_only_if_the_selected_body_has_them(body, rays, light):
    text = about(static(body=load_body(body)), "flock-1", 1)
    assert ("rays" in text, "light" in text) == (rays, light)


class SentPackets:
    """A recording that notes what it is sent."""

    def __init__(self):
        self.rows = {}

    def send_columns(self, entity, index, columns):
        self.rows[entity] = columns


class Columns:
    """Columns of one field, in which rows can be counted."""

    def __init__(self, values):
        self.values = values

    def partition(self, lengths):
        return lengths


def refused(values):
    raise ValueError(f"no columns of {len(values)}")


@pytest.mark.parametrize(
    ("fields", "least", "most"),
    [
        ({"a": np.zeros((100, 3), np.float32)}, 1200, 1200),
        ({"a": np.zeros((10, 2)), "b": np.zeros(10, np.uint32)}, 200, 200),
        ({"a": [np.zeros((49, 2)), np.zeros((5, 2))]}, 54 * 16, 54 * 16),
        ({"a": ["x" * 5000]}, 5000, 5100),
        ({"a": []}, 0, 0),
    ],
)
def test_buffered_bytes_count_all_fields_of_any_container(fields, least, most):
    rows = RerunRows(SentPackets())
    for tick in range(3):
        rows.begin_tick(tick, tick)
        rows.add("entity", Columns, **fields)
    assert 3 * least <= rows.buffered_bytes - 3 * ROW_BYTES <= 3 * most


def test_entity_that_fails_is_reported_and_the_others_are_sent():
    pytest.importorskip("rerun", reason="needs the extra [view]")
    rec = SentPackets()
    rows = RerunRows(rec)
    for tick in range(2):
        rows.begin_tick(tick, tick)
        for entity, columns in (("before", Columns), ("bad", refused), ("worse", refused), ("after", Columns)):
            rows.add(entity, columns, values=np.zeros(3 if entity == "bad" else 4))
    with pytest.raises(ValueError, match="no columns of 6"):
        rows.send()
    assert rec.rows == {"before": [4, 4], "after": [4, 4]}
    rows.send()  # what failed is not tried again
    assert rows.buffered_bytes == 0

"""A run as an MCAP file holds the run's own tables, by the reader of its format and by two decoders of ROS 2."""

from math import atan2
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

pytest.importorskip("mcap", reason="needs the extra [ros2]")

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from swarmwire.deploy import Recording, RunFolder, run
from swarmwire.deploy.cli.actions.export import export
from swarmwire.deploy.cli.exporters import ExportOptions
from swarmwire.world.motion.traces.reading import read_trace
from tests.support.refusals import refused_input

SCENARIO = """
format = 1
name = "scene"
seed = 3
duration_s = 1.5
stop = []
[arena]
size_m = [4.0, 3.0]
obstacles = [
    { shape = "polygon", points = [[0.0, -0.2], [0.2, 0.2], [-0.2, 0.2]], at = [1.5, 1.0] },
    { shape = "box", size_m = [0.2, 0.2], at = [-1.5, 1.0], height_m = 0.3 },
    { shape = "cylinder", radius_m = 0.1, at = [-1.0, 0.0], movable = true, mass_kg = 0.2 },
]
[robots.flock]
body = "epuck"
count = 3
agent = "noting.py:Noting"
[robots.flock.place]
how = "poses"
poses = [[-1.16, 0.0, 0.0], [0.0, -1.0, 2.0], [1.0, 0.0, -1.0]]
[radio]
range_m = 2.0
loss = 0.3
[[events]]
at_s = 0.7
do = "kill"
robots = { names = ["flock-2"] }
"""
AGENT = """
from swarmwire.agent import Agent, Message, f4

class Beat(Message):
    number: f4

class Noting(Agent):
    needs = ("compass",)

    def step(self, robot):
        robot.note(state="early" if robot.time_s < 0.5 else "late", value=robot.time_s)
        robot.radio.send(Beat(number=1.0))
        robot.drive(linear_mps=0.1, angular_radps=0.1)
"""


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[RunFolder, Path]:
    """A run in which a robot pushes an obstacle and another dies, and its bag."""
    folder = tmp_path_factory.mktemp("bag")
    (folder / "noting.py").write_text(AGENT)
    (folder / "scenario.toml").write_text(SCENARIO)
    run(folder / "scenario.toml", out=folder / "run", record=Recording(packets=1.0, rrd=False))
    export(folder / "run", folder / "run.mcap", ExportOptions())
    return RunFolder(folder / "run"), folder / "run.mcap"


def messages(bag: Path) -> dict[str, list[tuple[int, Any]]]:
    """Times and messages by topic, as mcap-ros2-support decodes them."""
    by_topic: dict[str, list[tuple[int, Any]]] = {}
    with bag.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False):
            by_topic.setdefault(channel.topic, []).append((message.log_time, decoded))
    return by_topic


def column(folder: RunFolder, *names: str) -> Any:
    """Lists of the table `ticks`, (ticks, robots, names)."""
    return np.stack([folder.ticks()[name].to_numpy() for name in names], axis=-1).astype(np.float64)


def yaw(turned: Any) -> float:
    return 2.0 * atan2(turned.z, turned.w)


def test_bag_has_the_poses_velocities_commands_and_notes_of_the_tables(recorded: tuple[RunFolder, Path]) -> None:
    folder, bag = recorded
    by_topic, names = messages(bag), ["flock_0", "flock_1", "flock_2"]
    pose, velocity = column(folder, "x_m", "y_m", "heading_rad"), column(folder, "vx_mps", "vy_mps")
    ticks = folder.ticks()
    times = [round(time_s * 1e9) for time_s in ticks["time_s"]]
    assert len(times) == 15
    transforms = [message.transforms for _, message in by_topic["/tf"]]
    for robot, name in enumerate(names):
        truths = by_topic[f"/{name}/ground_truth"]
        assert [time for time, _ in truths] == times
        for tick, (time, message) in enumerate(truths):
            stamp, at, frame = message.header.stamp, message.pose.pose, transforms[tick][robot]
            assert stamp.sec * 10**9 + stamp.nanosec == time
            assert (message.header.frame_id, message.child_frame_id) == ("map", f"{name}/base_link")
            assert (frame.header.frame_id, frame.child_frame_id) == ("map", f"{name}/base_link")
            heading = pose[tick, robot, 2]
            turn = frame.transform
            for where, turned in ((at.position, at.orientation), (turn.translation, turn.rotation)):
                assert (where.x, where.y, where.z) == (*pose[tick, robot, :2], 0.0)
                assert np.cos(yaw(turned) - heading) == pytest.approx(1.0)
            moved = message.twist.twist.linear  # turned back into the arena's frame
            turned_back = complex(moved.x, moved.y) * np.exp(1j * heading)
            assert turned_back == pytest.approx(complex(*velocity[tick, robot]), abs=1e-9)
        commands = [(message.linear.x, message.angular.z) for _, message in by_topic[f"/{name}/cmd_vel"]]
        assert np.array_equal(commands, column(folder, "command_forward_mps", "command_turn_radps")[:, robot])
    assert [(time, message.data) for time, message in by_topic["/flock_0/state"]] == [(0, "early"), (5 * 10**8, "late")]
    assert [message.data for _, message in by_topic["/flock_0/value"]] == pytest.approx(np.arange(15) / 10)
    events = [(time, message.level, message.msg) for time, message in by_topic["/events"]]
    assert events == [(7 * 10**8, 30, "kill: flock_2")]
    order = [(time, message.data) for time, message in by_topic["/metrics/order"]]
    assert order == list(zip(times, ticks["order"], strict=True))


def test_bag_has_each_packet_with_its_fate_and_lines_between_the_robots(recorded: tuple[RunFolder, Path]) -> None:
    folder, bag = recorded
    by_topic, packets = messages(bag), folder.packets().sort("final_at_ns", maintain_order=True)
    assert {"received", "lost"} <= set(packets["fate"]), "the run is no test of fates"
    name = {None: "", 0: "flock_0", 1: "flock_1", 2: "flock_2"}
    for (time, message), row in zip(by_topic["/packets"], packets.iter_rows(named=True), strict=True):
        assert (time, message.fate, message.sequence) == (row["final_at_ns"], row["fate"], row["sequence"])
        assert (message.sender, message.receiver) == (name[row["sender"]], name[row["receiver"]])
        assert message.distance_m == pytest.approx(row["distance_m"]) or row["distance_m"] is None
        assert bytes(message.payload) == row["payload"]
        assert message.on_air.sec * 10**9 + message.on_air.nanosec == row["on_air_at_ns"]
    pose = column(folder, "x_m", "y_m")
    for time, message in by_topic["/packets/lines"]:
        tick = round(time / 1e8)
        ended = packets.filter(pl.col("final_at_ns").is_between(time - 10**8, time, closed="right"))
        drawn = {marker.ns: np.array([(point.x, point.y) for point in marker.points]) for marker in message.markers}
        assert all(marker.lifetime.nanosec == 10**8 for marker in message.markers)
        for fate, share in (("received", 1.0), ("lost", 0.4)):
            rows = ended.filter(pl.col("fate") == fate).drop_nulls("receiver")
            start, end = (pose[tick][rows[side].to_numpy()] for side in ("sender", "receiver"))
            lines = np.stack([start, start + share * (end - start)], axis=1).reshape(-1, 2)
            assert np.allclose(drawn.get(fate, np.zeros((0, 2))), lines)


def test_bag_opens_as_a_bag_with_rising_times_and_all_frames_below_the_map(recorded: tuple[RunFolder, Path]) -> None:
    folder, bag = recorded
    with AnyReader([bag]) as reader:
        read = [(row.topic, time, reader.deserialize(raw, row.msgtype)) for row, time, raw in reader.messages()]
    with bag.open("rb") as file:
        mcap = make_reader(file)
        summary, order = mcap.get_summary(), [row[2].log_time for row in mcap.iter_messages(log_time_order=False)]
        assert mcap.get_header().profile == "ros2"
    assert summary.statistics.message_count == len(read) == len(order)
    assert {channel.message_encoding for channel in summary.channels.values()} == {"cdr"}
    assert order == sorted(order)
    below = {pose.child_frame_id for topic, _, message in read if topic == "/tf" for pose in message.transforms}
    markers = [marker for _, _, message in read if hasattr(message, "markers") for marker in message.markers]
    assert {marker.header.frame_id for marker in markers} == {"map", *below}
    assert len(below) == 3

    shapes = {topic: [message.markers for name, _, message in read if name == topic] for topic in ("/arena", "/bodies")}
    (scene,) = shapes["/arena"]
    extent = {marker.ns: (marker.scale.x, marker.scale.y) for marker in scene}
    assert extent["floor"] == (4.0, 3.0)
    assert len([marker for marker in scene if marker.ns == "walls"]) == 4
    (triangles,) = [marker for marker in scene if marker.type == 11]
    corners = {(round(1.5 + x, 9), round(1.0 + y, 9)) for x, y in ((0.0, -0.2), (0.2, 0.2), (-0.2, 0.2))}
    assert {(round(point.x, 9), round(point.y, 9)) for point in triangles.points} == corners
    assert len(triangles.points) == 3 * (1 + 2 * 3)  # top, and two triangles per side
    alive, after = shapes["/bodies"]
    radius_m = folder.static.groups[0].body.radius_m
    assert all(marker.scale.x == 2 * radius_m and marker.frame_locked for marker in alive if marker.ns == "bodies")
    grey = [marker.header.frame_id for old, marker in zip(alive, after, strict=True) if marker.color != old.color]
    assert grey == ["flock_2/base_link"]
    pushed = [message.markers[0].pose.position.x for topic, _, message in read if topic == "/movables"]
    moved = column(folder, "movable_x_m")[:, 0, 0]
    assert moved[-1] > moved[0], "nothing was pushed"
    assert pushed == [x_m for tick, x_m in enumerate(moved) if tick == 0 or x_m != moved[tick - 1]]


def test_bag_of_a_part_begins_and_ends_there_and_its_transforms_are_a_trace(
    recorded: tuple[RunFolder, Path], tmp_path: Path
) -> None:
    folder, _ = recorded
    export(folder.path, tmp_path / "part.mcap", ExportOptions(from_s=0.35, until_s=1.0))
    by_topic = messages(tmp_path / "part.mcap")
    times = [time for topic in by_topic.values() for time, _ in topic]
    assert (min(times), max(times)) == (4 * 10**8, 10**9)
    assert len(by_topic["/arena"]) == len(by_topic["/bodies"]) - 1 == 1
    trace = read_trace(tmp_path / "part.mcap")
    rows = trace.names.index("/flock_1/ground_truth")
    part = slice(trace.first[rows], trace.first[rows + 1])
    assert np.array_equal(trace.x_m[part], column(folder, "x_m")[4:11, 1, 0])

    with refused_input("--from"):
        export(folder.path, tmp_path / "none.mcap", ExportOptions(from_s=7.0))
    assert not (tmp_path / "none.mcap").exists()

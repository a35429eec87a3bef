"""Bags of ROS 2 as traces: files written by rosbags, with messages of another library, and metadata written here."""

import json
from math import cos, inf, nan, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from swarmwire.comms.base.errors import BadInput
from swarmwire.world.motion.traces.reading import files_of, read_trace
from swarmwire.world.motion.traces.trace import TracePoses
from tests.support.comms.protocols.ros2 import independent
from tests.support.refusals import refused_input

STORE = get_typestore(Stores.ROS2_JAZZY)
DAY_S = 1_790_000_000  # stamps count from 1970


def pose(x_m: float, heading_rad: float) -> independent.Pose:
    orientation = independent.Quaternion(0.0, 0.0, sin(heading_rad / 2), cos(heading_rad / 2))
    return independent.Pose(independent.Point(x_m, -1.0, 2.0), orientation)


def header(time_s: float) -> independent.Header:
    return independent.header(round((DAY_S + time_s) * 10) * 10**8, "map")


def stamped(time_s: float, x_m: float, heading_rad: float = 0.5) -> independent.PoseStamped:
    return independent.PoseStamped(header(time_s), pose(x_m, heading_rad))


def odometry(time_s: float, x_m: float) -> independent.Odometry:
    posed = independent.PoseWithCovariance(pose(x_m, 0.5), [0.0] * 36)
    still = independent.TwistWithCovariance(independent.Twist(), [0.0] * 36)
    return independent.Odometry(header(time_s), "base_link", posed, still)


def transform(time_s: float, frame: str, x_m: float) -> independent.TransformStamped:
    at = independent.Transform(independent.Vector3(x_m, -1.0, 2.0), pose(0.0, 0.5).orientation)
    return independent.TransformStamped(header(time_s), frame, at)


def bag(folder: Path, *messages: tuple[str, Any], storage: StoragePlugin = StoragePlugin.MCAP) -> Path:
    """The file of a bag with messages of these topics, a second of the recorder's clock apart."""
    connections: dict[str, Any] = {}
    with Writer(folder / "bag", version=9, storage_plugin=storage) as writer:
        for second, (topic, message) in enumerate(messages):
            kind = type(message).__idl_typename__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
            writer.write(connections[topic], second * 10**9, message.serialize())
    return folder / "bag" / ("bag.mcap" if storage == StoragePlugin.MCAP else "bag.db3")


def split(folder: Path, files: list[Path], counts: dict[str, int]) -> Path:
    """The folder of a bag of several files; `counts`: messages of each topic, which are PoseStamped."""
    folder.mkdir()
    for number, file in enumerate(files):
        file.rename(folder / f"split_{number}{file.suffix}")
    topics = [
        {
            "topic_metadata": {
                "name": topic, "type": independent.PoseStamped.__idl_typename__, "serialization_format": "cdr",
                "offered_qos_profiles": [], "type_description_hash": "",
            },
            "message_count": count,
        }
        for topic, count in counts.items()
    ]  # fmt: skip
    information = {
        "version": 9,
        "storage_identifier": "mcap" if files[0].suffix == ".mcap" else "sqlite3",
        "duration": {"nanoseconds": 10**9},
        "starting_time": {"nanoseconds_since_epoch": 0},
        "message_count": sum(counts.values()),
        "topics_with_message_count": topics,
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [f"split_{number}{file.suffix}" for number, file in enumerate(files)],
        "files": [],
        "custom_data": {},
        "ros_distro": "jazzy",
    }
    (folder / "metadata.yaml").write_text(json.dumps({"rosbag2_bagfile_information": information}))  # JSON is YAML
    return folder


@pytest.mark.parametrize("storage", StoragePlugin)
def test_rosbag_folder_of_several_files_is_one_trace(tmp_path: Path, storage: StoragePlugin) -> None:
    files = list[Path]()
    for name, messages in (
        ("first", [("/b", stamped(0.5, 5.0)), ("/a", stamped(1.0, 1.0))]),
        ("second", [("/a", stamped(2.0, 2.0))]),
    ):
        (tmp_path / name).mkdir()
        files.append(bag(tmp_path / name, *messages, storage=storage))
    assert read_trace(files[0]).x_m.tolist() == [1.0, 5.0]
    assert read_trace(files[0].parent).x_m.tolist() == [1.0, 5.0]
    folder = split(tmp_path / "split", files, {"/a": 2, "/b": 1})
    trace = read_trace(folder)
    assert (trace.names, trace.first.tolist()) == (("/a", "/b"), [0, 2, 3])
    assert (trace.t_s.tolist(), trace.x_m.tolist()) == ([0.5, 1.5, 0.0], [1.0, 2.0, 5.0])
    (folder / "notes.txt").touch()
    suffix = files[0].suffix
    assert [file.name for file in files_of(folder)] == ["metadata.yaml", f"split_0{suffix}", f"split_1{suffix}"]


def test_rosbag_folder_that_lacks_a_file_or_messages_is_refused(tmp_path: Path) -> None:
    folder = split(tmp_path / "split", [bag(tmp_path, ("/a", stamped(0.0, 1.0)))], {"/a": 2})
    with refused_input(folder, "", "1 of the messages .* are missing"):
        read_trace(folder)
    (folder / "split_0.mcap").unlink()
    with refused_input(folder, "", "split_0.mcap"):
        read_trace(folder)


def test_rosbag_topics_are_robots_in_natural_order_and_times_count_from_the_first_stamp(tmp_path: Path) -> None:
    path = bag(
        tmp_path,
        ("/robot_10/odom", odometry(0.5, 10.0)),
        ("/robot_2/odom", odometry(0.0, 2.0)),
        ("/robot_2/imu", independent.Imu(header(-5.0), independent.Quaternion(), [0.0] * 9, independent.Vector3(),
                                         [0.0] * 9, independent.Vector3(), [0.0] * 9)),
        ("/robot_10/odom", odometry(1.5, 14.0)),
    )  # fmt: skip
    trace = read_trace(path)
    assert trace.names == ("/robot_2/odom", "/robot_10/odom")
    assert trace.first.tolist() == [0, 1, 3]
    assert trace.t_s.tolist() == [0.0, 0.5, 1.5]
    expected = [[2.0, -1.0, 2.0, 0.5], [12.0, -1.0, 2.0, 0.5]]
    assert TracePoses(trace, [0, 1], 0.0).at(1.0) == pytest.approx(np.array(expected))


def test_rosbag_headings_turn_the_short_way_and_may_lack(tmp_path: Path) -> None:
    lacking = stamped(2.0, 5.0)
    lacking.pose.orientation = independent.Quaternion(0.0, 0.0, 0.0, 0.0)
    path = bag(
        tmp_path,
        ("/a", stamped(0.0, 0.0, pi - 0.25)),
        ("/a", stamped(1.0, 1.0, 0.25 - pi)),
        ("/b", lacking),
    )
    trace = read_trace(path)
    assert abs(TracePoses(trace, [0], 0.0).at(0.5)[0, 3]) == pytest.approx(pi)
    assert np.isnan(trace.heading_rad).tolist() == [False, False, True]


def test_rosbag_transforms_are_robots_by_topic_parent_and_frame(tmp_path: Path) -> None:
    first = independent.TFMessage([transform(0.0, "r1", 1.0), transform(0.0, "/r2", 2.0)])
    path = bag(tmp_path, ("/tf", first), ("/tf", independent.TFMessage([transform(1.0, "r2", 3.0)])))
    trace = read_trace(path)
    assert trace.names == ("/tf map r1", "/tf map r2")
    assert trace.x_m.tolist() == [1.0, 2.0, 3.0]


def test_rosbag_poses_are_sorted_by_their_stamps(tmp_path: Path) -> None:
    trace = read_trace(bag(tmp_path, ("/a", stamped(1.0, 1.0)), ("/a", stamped(0.0, 0.0)), ("/a", stamped(2.0, 2.0))))
    assert trace.t_s.tolist() == trace.x_m.tolist() == [0.0, 1.0, 2.0]


def test_rosbag_without_stamps_or_poses_is_refused(tmp_path: Path) -> None:
    for name in "abc":
        (tmp_path / name).mkdir()
    path = bag(tmp_path / "a", ("/a", stamped(0.0, 1.0)), ("/a", stamped(0.0, 0.0)))
    with refused_input(path, "/a", "stamps"):
        read_trace(path)
    path = bag(tmp_path / "b", ("/clock", independent.Clock(independent.Time(5, 0))))
    with refused_input(path, "", "at least one robot"):
        read_trace(path)
    path = bag(tmp_path / "c")
    with refused_input(path, "", "at least one robot"):
        read_trace(path)


@pytest.mark.parametrize("x_m", [nan, inf, 1e16])
def test_rosbag_pose_that_is_not_finite_is_refused_with_its_topic(tmp_path: Path, x_m: float) -> None:
    path = bag(tmp_path, ("/b", stamped(0.0, 0.0)), ("/a", stamped(0.0, 0.0)), ("/a", stamped(1.0, x_m)))
    with refused_input(path, "message 2 of /a", "PoseStamped"):
        read_trace(path)


@pytest.fixture(scope="module")
def intact(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file with three transforms of a robot."""
    messages = [("/tf", independent.TFMessage([transform(k, "r1", 1.0)])) for k in range(3)]
    return bag(tmp_path_factory.mktemp("intact"), *messages)


@settings(max_examples=40, deadline=None)
@given(at=st.floats(0.0, 1.0), removed=st.integers(0, 40), inserted=st.binary(max_size=40))
def test_damaged_bag_is_refused_or_gives_finite_poses(intact: Path, at: float, removed: int, inserted: bytes) -> None:
    content, path = intact.read_bytes(), intact.with_name("damaged.mcap")
    start = int(at * len(content))
    path.write_bytes(content[:start] + inserted + content[start + removed :])
    try:
        trace = read_trace(path)
    except BadInput:
        return
    assert np.isfinite(TracePoses(trace, range(len(trace.names)), 0.0).at(0.5)).all()


def test_missing_rosbag_and_missing_rosbags_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with refused_input(tmp_path / "a.mcap", ""):
        read_trace(tmp_path / "a.mcap")
    (tmp_path / "a.mcap").write_bytes(b"\xff\xfe\x00\x80")
    with refused_input(tmp_path / "a.mcap", "", "intact bag"):
        read_trace(tmp_path / "a.mcap")
    monkeypatch.setattr("swarmwire.comms.base.extras.find_spec", lambda _: None)
    with refused_input(tmp_path / "a.mcap", "", r"install swarmwire-agent\[ros2\]"):
        read_trace(tmp_path / "a.mcap")

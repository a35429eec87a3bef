"""Poses of ROS 2 topics, published by another library's messages over rmw_zenoh's keys and a bridge's."""

from collections.abc import Callable, Generator
from contextlib import closing, contextmanager
from math import cos, nan, sin
from typing import Any, get_args

import pytest
import zenoh

from swarmwire.comms.base.clock import NEVER_NS, WallClock
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.protocols.ros2.links import close, open_client, open_router
from swarmwire.comms.protocols.ros2.messages import DISTROS
from swarmwire.world.motion.ros2 import Ros2Source
from swarmwire.world.scenario.motion import Ros2Motion
from tests.support.clocks import until
from tests.support.comms.protocols.ros2 import independent
from tests.support.comms.protocols.ros2.type_hashes import rihs01
from tests.support.refusals import refused_input
from tests.support.world.gateways import PROPER

ANY_PORT = "tcp/127.0.0.1:0"
ODOMETRY, POSE, TF = "nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped", "tf2_msgs/msg/TFMessage"
NAMES = ("flock-0", "flock-1")
EXPECTED = {3: pytest.approx([1.0, 2.0, 3.0, 0.5]), 4: pytest.approx([1.5, 2.0, 3.0, 0.5])}


def pose(x_m: float) -> independent.Pose:
    """A pose at (x_m, 2, 3) with heading 0.5."""
    return independent.Pose(independent.Point(x_m, 2.0, 3.0), independent.Quaternion(0.0, 0.0, sin(0.25), cos(0.25)))


def odometry(x_m: float) -> independent.Odometry:
    posed = independent.PoseWithCovariance(pose(x_m), [0.0] * 36)
    still = independent.TwistWithCovariance(independent.Twist(), [0.0] * 36)
    return independent.Odometry(independent.header(5, "odom"), "base_footprint", posed, still)


def stamped(x_m: float) -> independent.PoseStamped:
    return independent.PoseStamped(independent.header(5, "map"), pose(x_m))


def transforms(*frames: tuple[str, str, float]) -> independent.TFMessage:
    """Transforms of frames in their parents: parent, frame and x."""
    messages: list[independent.TransformStamped] = []
    for parent, frame, x_m in frames:
        transform = independent.Transform(independent.Vector3(x_m, 2.0, 3.0), pose(0.0).orientation)
        messages.append(independent.TransformStamped(independent.header(5, parent), frame, transform))
    return independent.TFMessage(messages)


def source_of(**settings: Any) -> Ros2Source:
    motion = Ros2Motion(source="ros2", **({"listen": [ANY_PORT]} | settings))
    return Ros2Source(motion, NAMES, [3, 4], (100.0, 100.0), WallClock())


@contextmanager
def opened(source: Ros2Source) -> Generator[zenoh.Session]:
    """A node's session at the source's router."""
    source.open()
    with closing(source):
        node = open_client(source.address.rpartition(" at ")[2], 20.0)
        try:
            yield node
        finally:
            close(node)


def publish(node: zenoh.Session, topic: str, message: Any, payload: bytes | None = None, domain: int = 0) -> None:
    """Publish as a node of rmw_zenoh."""
    package, folder, name = type(message).__idl_typename__.split("/")
    key = f"{domain}/{topic}/{package}::{folder}::dds_::{name}_/{rihs01(type(message))}"
    node.put(key, message.serialize() if payload is None else payload, attachment=PROPER)


def rows_of(source: Ros2Source) -> dict[int, list[float]]:
    """New poses by row."""
    table, rows = source.pop_new(NEVER_NS), dict[int, list[float]]()
    for row, value in zip(table.rows.tolist(), table.value.tolist(), strict=True):
        rows.setdefault(row, []).append(value)
    return rows


def until_all_have_poses(source: Ros2Source, send: Callable[[int, float], None]) -> None:
    """Send the poses of both robots until they are there."""

    def sent() -> bool:
        for index in range(2):
            send(index, 1.0 + 0.5 * index)
        return not source.missing()

    until(sent)


@pytest.mark.parametrize(
    ("kind", "topic", "message", "settings"),
    [
        (ODOMETRY, "flock_{}/odom", odometry, {}),
        (POSE, "flock_{}/pose", stamped, {}),
        (ODOMETRY, "robot{}/ground_truth", odometry, {"topic": "robot{index}/ground_truth", "domain": 7}),
    ],
)
def test_poses_of_each_robots_topic_reach_its_row(kind, topic, message, settings):
    source, domain = source_of(type=kind, **settings), settings.get("domain", 0)
    with opened(source) as node:
        until_all_have_poses(source, lambda index, x_m: publish(node, topic.format(index), message(x_m), domain=domain))
        assert rows_of(source) == EXPECTED
        assert source.counts() == {}
    assert source.report().received >= 2


@pytest.mark.parametrize(("kind", "message"), [(ODOMETRY, odometry), (POSE, stamped)])
def test_poses_of_a_bridge_have_neither_type_nor_attachment(kind, message):
    source = source_of(type=kind, transport="bridge", topic="/{name}/state")
    with opened(source) as node:
        until_all_have_poses(source, lambda index, x_m: node.put(f"flock_{index}/state", message(x_m).serialize()))
        assert rows_of(source) == EXPECTED


@pytest.mark.parametrize(
    ("settings", "frames"),
    [
        ({}, [("map", "flock_0/base_link", 1.0), ("map", "flock_1/base_link", 1.5)]),
        (
            {"parent": "world", "frame": "cf{number}"},
            [("world", "cf1", 1.0), ("world", "cf2", 1.5), ("odom", "cf1", 9.0), ("world", "wheel", 9.0)],
        ),
    ],
)
def test_poses_of_a_shared_tf_are_told_apart_by_frame(settings, frames):
    source = source_of(type=TF, **settings)
    with opened(source) as node:
        until(lambda: (publish(node, "tf", transforms(*frames)), not source.missing())[1])
        assert rows_of(source) == EXPECTED
        assert source.counts() == {}


def test_stamps_of_headers_order_the_poses():
    source = source_of(type=POSE, stamps=True)
    with opened(source) as node:
        until_all_have_poses(source, lambda index, x_m: publish(node, f"flock_{index}/pose", stamped(x_m)))
        older = independent.PoseStamped(independent.header(4, "map"), pose(1.05))
        publish(node, "flock_0/pose", older)
        assert until(source.counts) == {"poses_late": 1}
        assert rows_of(source) == EXPECTED


def test_tf_topic_of_each_robot_may_have_equal_frames():
    source = source_of(type=TF, topic="/{name}/tf", frame="base_footprint", parent="odom")
    with opened(source) as node:
        until_all_have_poses(
            source, lambda index, x_m: publish(node, f"flock_{index}/tf", transforms(("odom", "base_footprint", x_m)))
        )
        assert rows_of(source) == EXPECTED


def test_malformed_poses_are_counted_and_those_beside_them_are_used():
    source = source_of(type=TF, max_age_s=3600)
    with opened(source) as node:
        good = transforms(("map", "flock_1/base_link", 1.5))
        until(lambda: (publish(node, "tf", good), "flock-1" not in source.missing())[1])
        assert source.counts() == {}
        publish(node, "tf", good, b"\0\1\0\0\xff\xff\xff\xff")
        publish(node, "tf", good, b"")
        node.put(f"0/tf/tf2_msgs::msg::dds_::TFMessage_/{rihs01(independent.TFMessage)}", good.serialize())
        publish(node, "tf", transforms(("map", "flock_0/base_link", nan), ("map", "flock_1/base_link", 1.55)))
        until(lambda: rows_of(source).get(4, [0.0])[0] == 1.55)
    assert source.counts()["poses_malformed"] == 4
    assert source.missing() == ["flock-0"]


def test_source_connects_to_a_router_that_starts_later():
    router, endpoint = open_router(ANY_PORT)
    close(router)
    source = source_of(connect=[endpoint], listen=[])
    source.open()
    with closing(source):
        router, _ = open_router(endpoint)
        try:
            until_all_have_poses(source, lambda index, x_m: publish(router, f"flock_{index}/odom", odometry(x_m)))
        finally:
            close(router)
        assert rows_of(source) == EXPECTED


def test_source_is_a_subscriber_in_the_graph_of_ros():
    with opened(source_of()) as node:

        def tokens() -> list[str]:
            replies = node.liveliness().get("@ros2_lv/0/**")
            return sorted(str(reply.ok.key_expr).split("/", 5)[5] for reply in replies if reply.ok)

        until(lambda: len(tokens()) == 3)
        entities = tokens()
    kind = f"nav_msgs::msg::dds_::Odometry_/{rihs01(independent.Odometry)}/::,10:,:,:,,"
    assert entities == [
        f"MS/%/%/swarmwire_poses/%flock_0%odom/{kind}",
        f"MS/%/%/swarmwire_poses/%flock_1%odom/{kind}",
        "NN/%/%/swarmwire_poses",
    ]


@pytest.mark.parametrize(
    ("key", "settings"),
    [
        ("topic", {"topic": "/odom"}),
        ("topic", {"topic": "/{nam}/odom"}),
        ("topic", {"topic": "/{index}/odom"}),  # a name in ROS does not begin with a digit
        ("frame", {"type": TF, "frame": "base_link"}),
        ("connect", {"connect": ["127.0.0.1:7447"]}),
        ("listen", {"listen": ["tcp/192.0.2.1:7447"]}),
        ("namespace", {"namespace": "/"}),
        ("namespace", {"namespace": "/{index}"}),
        ("namespace", {"namespace": "/robots"}),
    ],
)
def test_setting_that_cannot_be_used_is_refused(key, settings):
    with refused_input(key=key):
        source_of(**settings).open()


def test_source_without_rosbags_names_the_pip_command(monkeypatch):
    monkeypatch.setattr("swarmwire.comms.base.extras.find_spec", lambda _: None)
    with pytest.raises(BadInput, match=r"install swarmwire-agent\[ros2\]"):
        source_of().open()


def test_distributions_of_the_setting_are_those_of_the_messages():
    assert get_args(Ros2Motion.model_fields["distro"].annotation) == DISTROS

"""A client by others, zenoh-ros2-sdk, at the gateway and at topics on the radio; and its hashes of all types.

It would clone definitions of messages from the network, so it gets them as files: rosbags' definitions, from which it
computes hashes and messages by itself.
"""

from collections import defaultdict
from collections.abc import Generator
from contextlib import closing
from typing import Any

import numpy as np
import pytest

from swarmwire.comms.protocols.ros2.keys import BYTES, CLOCK, TWIST, TWIST_STAMPED
from swarmwire.comms.protocols.ros2.messages import Messages
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.deploy import Simulation
from swarmwire.world.gateways.ros2 import Ros2GatewayOptions
from swarmwire.world.gateways.ros2.publishers import broadcasters_of
from swarmwire.world.scenario_file import scenario_from
from tests.support.clocks import until
from tests.support.comms.protocols.ros2.definitions import write_definitions

sdk = pytest.importorskip("zenoh_ros2_sdk", reason="needs the development group")
MAP = "nav_msgs/msg/OccupancyGrid"
BODIES = ("turtlebot4", "turtlebot3-burger", "epuck2")
ANNOUNCED = {TWIST, TWIST_STAMPED, CLOCK, BYTES, MAP} | {
    topic.kind for body in BODIES for topic in broadcasters_of(load_body(body), 1, Ros2GatewayOptions())
}


@pytest.fixture(scope="module")
def registry(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Its registry, with the definitions of all types."""
    from zenoh_ros2_sdk.message_registry import get_registry

    return get_registry(str(write_definitions(tmp_path_factory.mktemp("messages"), ANNOUNCED)))


@pytest.mark.parametrize("kind", sorted(ANNOUNCED))
def test_ros2_type_hash_is_that_of_the_sdk(kind, registry):
    from zenoh_ros2_sdk.utils import get_type_hash, load_dependencies_recursive

    definition = registry.get_msg_file_path(kind).read_text()
    dependencies = load_dependencies_recursive(kind, definition, registry)
    assert Messages("jazzy").hash_of(kind) == get_type_hash(kind, definition, dependencies)


SCENARIO = {
    "format": 1,
    "name": "two bases",
    "duration_s": 120.0,
    "arena": {"size_m": [6.0, 6.0]},
    "robots": {
        "tb": {
            "body": "turtlebot3-burger",
            "count": 2,
            "agent": "swarmwire.agent.behaviours:Consensus",
            "place": {"how": "poses", "poses": [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]},
        }
    },
    "radio": {"preset": "wifi-a-6M", "loss": 0.2},
    "ros2": {"relay": {"topics": [{"name": "map", "type": MAP, "reliable": True}]}},
}


class Client:
    """The SDK as a node beside a run with the gateway."""

    def __init__(self, simulation: Simulation, port: int) -> None:
        self.simulation, self._port, self._open = simulation, port, list[Any]()
        self.received = defaultdict[str, list[Any]](list)

    def subscribe(self, topic: str, kind: str) -> None:
        self._open.append(
            sdk.ROS2Subscriber(topic, kind, self.received[topic].append, domain_id=0, router_port=self._port)
        )

    def publisher(self, topic: str, kind: str) -> Any:
        self._open.append(publisher := sdk.ROS2Publisher(topic, kind, domain_id=0, router_port=self._port))
        return publisher

    def step_until(self, is_done: Any, publish: Any = lambda: None) -> None:
        """Run ticks, with a message before each, until something holds."""
        while not is_done():
            publish()
            self.simulation.step()
            assert self.simulation.tick < self.simulation.plan.ticks

    def close(self) -> None:
        for each in self._open:
            each.close()
        sdk.ZenohSession.get_instance().close()


@pytest.fixture(scope="module")
def client(registry) -> Generator[Client]:
    with Simulation(scenario_from(SCENARIO, "two.toml"), gateways="ros2", realtime=2.0) as simulation:
        assert simulation.served
        port = int(simulation.served.robots[0].address.rpartition(":")[2])
        sdk.ZenohSession.get_instance("127.0.0.1", port)
        with closing(Client(simulation, port)) as client:
            yield client


def test_ros2_sdk_lists_topics_of_bases_and_of_their_radios(client):
    from zenoh_ros2_sdk.discovery import get_topic_names_and_types

    listed: dict[str, list[str]] = {}

    def complete() -> bool:
        listed.update(get_topic_names_and_types(domain_id=0))
        return "/clock" in listed

    until(complete)
    assert listed["/tb_0/odom"] == ["nav_msgs/msg/Odometry"]
    assert listed["/tb_1/cmd_vel"] == [TWIST]
    over_radio = {"map": MAP, "radio/tb_1/map": MAP, "radio/tx": BYTES, "radio/rx": BYTES}
    assert {topic: listed[f"/tb_0/{topic}"] for topic in over_radio} == {
        topic: [kind] for topic, kind in over_radio.items()
    }
    assert "/tb_0/radio/tb_0/map" not in listed


def test_ros2_sdk_receives_a_map_of_another_robot_over_the_radio(client):
    client.subscribe("/tb_1/radio/tb_0/map", MAP)
    maps, kinds = client.publisher("/tb_0/map", MAP), sdk.ZenohSession.get_instance().store.types
    time, number = kinds["builtin_interfaces/msg/Time"](5, 6), iter(range(1000))

    def make(kind: str, *fields: Any) -> Any:
        return kinds[kind](*fields)

    def publish() -> None:
        """Each map is filled with its number, in 4,000 cells: three packets."""
        pose = make(
            "geometry_msgs/msg/Pose",
            make("geometry_msgs/msg/Point", 1.0, 2.0, 0.0),
            make("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0),
        )
        maps.publish(
            header=make("std_msgs/msg/Header", time, "map"),
            info=make("nav_msgs/msg/MapMetaData", time, 0.05, 80, 50, pose),
            data=np.full(4000, next(number) % 100, np.int8),
        )

    received = client.received["/tb_1/radio/tb_0/map"]
    client.step_until(lambda: len(received) >= 10, publish)
    numbers = [int(each.data[0]) for each in received]
    assert numbers == sorted(set(numbers))
    assert all(len(each.data) == 4000 and set(each.data.tolist()) == {each.data[0]} for each in received)
    assert (received[0].info.width, received[0].header.frame_id) == (80, "map")

"""The table [ros2]: topics of ROS 2 nodes that cross the radio."""

from pydantic import Field

from swarmwire.world.scenario.tables import ScenarioTable


class RelayedTopicTable(ScenarioTable):
    """A topic of each robot that other robots receive over the radio."""

    name: str = Field(min_length=1)
    """Name in the robots' namespaces, such as "map": of /a/map robot b receives /b/radio/a/map."""
    type: str = Field(pattern=r"^\w+/msg/\w+$")
    """Type of the messages, such as nav_msgs/msg/OccupancyGrid."""
    definition: str | None = Field(default=None, min_length=1)
    """File with the definition of a type that rosbags does not know, as its .msg file; relative to the scenario. Other
    such types in it follow, each after a line of 80 "=" and a line "MSG: package/Name"."""
    to: tuple[str, ...] = Field(default=(), strict=False)
    """Robots or groups that receive it, each by packets of its own; default: all, by broadcast."""
    reliable: bool = False
    """Receivers ask for missing parts, and get the messages in order."""
    latched: bool = False
    """A late subscriber gets the last received message (transient local), as of maps."""


class RelayTable(ScenarioTable):
    """[ros2.relay]: the relayed topics, and requests for missing parts."""

    topics: tuple[RelayedTopicTable, ...] = Field(default=(), max_length=128, strict=False)
    """The relayed topics."""
    retry_after_s: float = Field(default=0.3, gt=0, le=3600, json_schema_extra={"unit": "s"})
    """A receiver asks for the missing parts of a reliable message once it heard none of them for this time."""
    retries: int = Field(default=3, ge=0, le=1000)
    """Number of such requests for a message, after which a receiver gives it up."""


class Ros2Table(ScenarioTable):
    """[ros2]: ROS 2 nodes at the robots."""

    relay: RelayTable = RelayTable()
    """Topics that cross the radio."""

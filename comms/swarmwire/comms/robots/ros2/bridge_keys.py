"""Keys and liveliness tokens of zenoh-bridge-ros2dds (zenoh-plugin-ros2dds: ros2_utils.rs, liveliness_mgt.rs).

A message travels under the full name of its topic without the first slash, as raw CDR. Tokens tell other bridges what
to announce in their own ROS graph.
"""

QOS = ":1:0:0,10"  # without a key, reliable, volatile, the last ten kept: what publishers have by default
READ, WRITE = "MS", "MP"  # the two directions of a topic in a token


def bridge_key(topic: str) -> str:
    """The key of a topic of this full name.

    >>> bridge_key("/flock_0/scan")
    'flock_0/scan'
    """
    return topic.removeprefix("/")


def bridge_token(zid: str, direction: str, topic: str, kind: str, type_hash: str) -> str:
    """The token of a topic that the bridge of this zenoh id writes or reads; READ or WRITE, seen from ROS."""
    names = "/".join(part.replace("/", "§") for part in (bridge_key(topic), kind))
    return f"{bridge_itself(zid)}/{direction}/{names}/{QOS}:typehash={type_hash};"


def bridge_itself(zid: str) -> str:
    """The token of the bridge of this zenoh id."""
    return f"@/{zid}/@ros2_lv"

"""Names as ROS 2 takes them: robots as namespaces, topics within them."""

import re

from swarmwire.comms.errors import BadInput

TOKEN = r"(?!.*__)[A-Za-z_][A-Za-z0-9_]*"
NAME = re.compile(rf"/?{TOKEN}(?:/{TOKEN})*")


def ros_name(robot: str) -> str:
    """The name of a robot as a ROS name: letters, digits and single underscores, none of the digits first.

    >>> ros_name("flock-0"), ros_name("7.left")
    ('flock_0', 'r7_left')
    """
    name = re.sub(r"[^A-Za-z0-9]+", "_", robot)
    return f"r{name}" if name[:1].isdigit() else name


def absolute(namespace: str, topic: str) -> str:
    """The full name of a topic: within the namespace, unless it starts with a slash itself.

    >>> absolute("flock_0", "scan"), absolute("/", "scan"), absolute("flock_0", "/clock")
    ('/flock_0/scan', '/scan', '/clock')
    """
    return topic if topic.startswith("/") else "/" + "/".join(filter(None, (namespace.strip("/"), topic)))


def check_name(name: str, where: str, key: str) -> None:
    """Raise BadInput with `where` and `key` if ROS 2 has no such names."""
    if not NAME.fullmatch(name):
        raise BadInput(where, key, f"expected a ROS name such as scan or robot_1/scan, got {name!r}")

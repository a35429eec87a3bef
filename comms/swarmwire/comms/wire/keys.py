"""Names of members, and the zenoh key expressions of a run.

A name is part of keys and file names, and the common name of a certificate. `Keys` are the keys at the agents'
endpoint, `ObserverKeys` the keys at the observers' endpoint.
"""

import re

EVERY_WORLD = "swarmwire/*/world"  # liveliness tokens of all runs at an endpoint
# A certificate has the name as a label of a host name, which may have 63 characters; a common name may have 64.
MAX_CHARACTERS = 63
_RULE = f"expected 1 to {MAX_CHARACTERS} letters (a to z), digits, - and _ that start with a letter and do not end in -"
_NAME = re.compile(rf"[A-Za-z](?:[A-Za-z0-9_-]{{0,{MAX_CHARACTERS - 2}}}[A-Za-z0-9_])?")


def fault_of_name(name: str) -> str | None:
    """Return the expectation that this name does not meet; None if the name is valid.

    >>> fault_of_name("flock-3") is None
    True
    >>> fault_of_name("radio/*")
    "expected 1 to 63 letters (a to z), digits, - and _ that start with a letter and do not end in -, got 'radio/*'"
    """
    return None if _NAME.fullmatch(name) else f"{_RULE}, got {name!r}"


class Keys:
    """Keys of one run at the agents' endpoint, under `swarmwire/{run}/`.

    A key that a runner queries or puts to contains the runner's name, so that access control can restrict the runner to
    these keys.
    """

    def __init__(self, run: str) -> None:
        self.root = f"swarmwire/{run}"
        self.world = f"{self.root}/world"  # liveliness token of the world
        self.any_session_info = f"{self.root}/session_info/*"
        self.any_join = f"{self.root}/join/*"
        self.any_answer = f"{self.root}/answer/*"
        self.any_alive = f"{self.root}/alive/*"

    def session_info(self, runner: str) -> str:
        """Queryable of the world: a runner requests the session info."""
        return f"{self.root}/session_info/{runner}"

    def join(self, runner: str) -> str:
        """Queryable of the world: a runner requests robots and gets its assignment."""
        return f"{self.root}/join/{runner}"

    def frame(self, runner: str) -> str:
        """Frames from the world to a runner, one per tick."""
        return f"{self.root}/frame/{runner}"

    def answer(self, runner: str) -> str:
        """Answers from a runner to the world, one per frame."""
        return f"{self.root}/answer/{runner}"

    def alive(self, runner: str) -> str:
        """Liveliness token of a runner."""
        return f"{self.root}/alive/{runner}"


def runner_of(key: str) -> str:
    """Return the runner's name at the end of a key."""
    return key.rsplit("/", 1)[-1]


def run_of(token: str) -> str:
    """Return the run of a world's liveliness token."""
    return token.split("/")[1]


class ObserverKeys:
    """Keys of one run at the observers' endpoint, under `swarmwire/{run}/`."""

    def __init__(self, run: str) -> None:
        root = f"swarmwire/{run}"
        self.published = f"{root}/published"  # liveliness token: the run is active and can be observed
        self.scene = f"{root}/scene"  # queryable: the constant facts of the run
        self.truth = f"{root}/truth"  # observed ticks at a limited rate; may be lost
        self.status = f"{root}/status"  # queryable: the run's status, for observers
        self.control = f"{root}/control"  # queryable: control requests, for operators


class SwarmKeys:
    """Keys of one swarm, under `swarmwire/{swarm}/`; a key contains the name of the robot that may put to it."""

    def __init__(self, swarm: str) -> None:
        self.root = f"swarmwire/{swarm}"
        self.any_radio = f"{self.root}/radio/*/*"
        self.any_pose = f"{self.root}/pose/*"
        self.any_control = f"{self.root}/control/*"
        self.any_bridge_sent = f"{self.root}/bridge/*/sent"
        self.any_bridge_join = f"{self.root}/bridge/*/join"

    def radio(self, robot: str, tag: int) -> str:
        """Packets of a robot whose message has this tag."""
        return f"{self.root}/radio/{robot}/{tag:04x}"

    def any_radio_of(self, robot: str) -> str:
        """All packets of a robot."""
        return f"{self.root}/radio/{robot}/*"

    def pose(self, robot: str) -> str:
        """Poses of a robot from the tracker, encoded by `radio_bridge.encode_pose`."""
        return f"{self.root}/pose/{robot}"

    def control(self, robot: str) -> str:
        """Queryable of a robot: "estop" and "status" requests of the operator."""
        return f"{self.root}/control/{robot}"

    def alive(self, robot: str) -> str:
        """Liveliness token of a robot's agent."""
        return f"{self.root}/alive/{robot}"

    def bridge_join(self, robot: str) -> str:
        """Queryable of the world's radio medium: a robot requests its `BridgeInfo`."""
        return f"{self.root}/bridge/{robot}/join"

    def bridge_sent(self, robot: str) -> str:
        """Packets from a robot with `--radio medium` to the world's medium, in `actions` frames."""
        return f"{self.root}/bridge/{robot}/sent"

    def bridge_received(self, robot: str) -> str:
        """Packets from the world's medium to a robot: a `tick` frame for each tick with packets for it."""
        return f"{self.root}/bridge/{robot}/received"

"""Key expressions in the network of robots, real ones and emulated ones that answer as such."""


class SwarmKeys:
    """The keys of one swarm, under `swarmwire/{swarm}/`; who may put what is in the key: a robot's own name."""

    def __init__(self, swarm: str) -> None:
        self.root = f"swarmwire/{swarm}"
        self.any_radio = f"{self.root}/radio/*/*"
        self.any_pose = f"{self.root}/pose/*"
        self.any_control = f"{self.root}/control/*"
        self.any_air_sent = f"{self.root}/air/*/sent"
        self.any_air_join = f"{self.root}/air/*/join"

    def radio(self, robot: str, tag: int) -> str:
        """A packet of this robot's; the tag of its message is its topic."""
        return f"{self.root}/radio/{robot}/{tag:04x}"

    def any_radio_of(self, robot: str) -> str:
        """All packets of this robot's."""
        return f"{self.root}/radio/{robot}/*"

    def pose(self, robot: str) -> str:
        """Where a tracker sees this robot, as `poses.encode_pose` has it."""
        return f"{self.root}/pose/{robot}"

    def control(self, robot: str) -> str:
        """Queryable of this robot: "estop" and "status", asked by whoever runs the swarm."""
        return f"{self.root}/control/{robot}"

    def alive(self, robot: str) -> str:
        """Liveliness token of this robot's agent."""
        return f"{self.root}/alive/{robot}"

    def air_join(self, robot: str) -> str:
        """Queryable of the world's air: this robot asks for its terms (`AirTerms`)."""
        return f"{self.root}/air/{robot}/join"

    def air_sent(self, robot: str) -> str:
        """From a robot with `--radio air` to the world's air: `actions` frames, of which the packets count."""
        return f"{self.root}/air/{robot}/sent"

    def air_heard(self, robot: str) -> str:
        """From the world's air to that robot, a `tick` frame for each tick in which it heard something."""
        return f"{self.root}/air/{robot}/heard"

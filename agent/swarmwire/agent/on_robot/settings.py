"""What the settings of one robot, `robot.toml`, say; read by `settings_file.py`."""

from dataclasses import dataclass, field
from typing import Any

from swarmwire.comms.config import parameter
from swarmwire.comms.wire.network import Network

FORMAT = 1  # of `robot.toml`


@dataclass(frozen=True)
class RadioSettings:
    """Which radio the agent has."""

    kind: str = parameter(
        "none",
        help="the robots' own network, the air of a world that emulates others nearby, or none",
        choices=("zenoh", "air", "none"),
    )
    max_payload_bytes: int = parameter(
        100, help="largest message, its tag included; larger ones are not sent", unit="B", at_least=2, at_most=65535
    )


@dataclass(frozen=True)
class DriverSettings:
    """Which driver, of which robot."""

    name: str = parameter(help="expected a driver, as `swarmwire-agent drivers` lists them")
    address: str = parameter("", help="where the robot is reached, as its driver says")
    options: dict[str, Any] = field(default_factory=dict[str, Any])  # as given; the driver says which there are


@dataclass(frozen=True)
class RobotSettings:
    """The settings of one robot; paths are absolute."""

    agent: str = parameter(help='the agent\'s class: "file.py:Class" beside this file, or "package.module:Class"')
    driver: DriverSettings = parameter(help='expected a table such as { name = "epuck2", address = "192.168.1.23" }')
    name: str = parameter("robot-0", help="this robot")
    swarm: str = parameter("swarm", help="the swarm: the root of its keys")
    robots: tuple[str, ...] = ()  # all of the swarm, in the order of their index; read: never empty
    params: dict[str, Any] = field(default_factory=dict[str, Any])
    body: str = parameter("", help="a body's name, or its sheet beside this file; else the driver's")
    rate_hz: int = parameter(10, help="steps of the agent per second", unit="Hz", at_least=1, at_most=1000)
    watchdog_s: float = parameter(0.5, help="motors stop when the agent is later", unit="s", at_least=0.01, at_most=10)
    max_linear_mps: float | None = parameter(None, help="fastest speed; else half the body's", unit="m/s", above=0)
    max_angular_radps: float | None = parameter(None, help="fastest turn; else half the body's", unit="rad/s", above=0)
    radio: RadioSettings = field(default_factory=RadioSettings)
    tracker: bool = parameter(False, help="whether poses of robots come over the network")
    network: Network | None = None
    log: str = parameter("", help="folder for the logs; else there is none")
    pace: float = parameter(
        1.0, help="times as fast as the wall clock, for an emulated robot", at_least=0.01, at_most=1000
    )
    seed: int = parameter(0, help="of the agent's draws, with the robot's index", at_least=0)
    format: int = FORMAT

    @property
    def index(self) -> int:
        """The robot's place in the swarm: the number by which others know it."""
        return self.robots.index(self.name)

"""Agent: the code that decides for one robot."""

from abc import ABC, abstractmethod
from typing import ClassVar

from swarmwire.agent.api_version import API_VERSION
from swarmwire.agent.robot import Robot


class Agent(ABC):
    """Decides for one robot, from what that robot alone senses and hears. One instance per robot.

    Annotated class attributes (float, int, bool, str) are its parameters, set before `__init__` runs; what it should
    remember it keeps in attributes of its own, made in `__init__`. `needs` names the senses of the body that it reads
    ("proximity", "compass", "odometry"), what it reads of a packet ("radio.range", "radio.bearing"), and
    "radio.outcomes" if it wants to know what became of packets that it sent to one robot. `api = 1` in its class says
    for which version of swarmwire.agent it was written: any other refuses it.
    """

    api: ClassVar[int] = API_VERSION
    needs: ClassVar[tuple[str, ...]] = ()

    @abstractmethod
    def step(self, robot: Robot) -> None:
        """Called once a tick in which the robot acts: read `robot`, then drive and send."""

    def hear(self, robot: Robot) -> None:  # noqa: B027 - most agents read in `step` alone
        """If it is defined: called between steps when packets have come, in real time with a quantum; read and send.

        What it is given, the next step is not. The senses are those of the last step, the time is now. Driving, lights,
        actuators and notes are for `step`. Elsewhere (lockstep, real time without a quantum, a real robot) it is never
        called, and all packets wait for the step: an agent must do without.
        """

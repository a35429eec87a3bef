"""Flocking over the radio: robots broadcast their headings; cohesion, separation and alignment."""

from collections.abc import Mapping
from typing import Any, ClassVar

from swarmwire.agent.behaviours._common import check_above_zero
from swarmwire.agent.fields import ahead, alignment, mean_received, repulsion_of_rays, spacing, steered
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import Memory, VectorAgent
from swarmwire.comms.robot.messages import Message, f4


class Heading(Message):
    """What a flocking robot broadcasts in every step."""

    heading_rad: f4  # of its compass


class Flocking(VectorAgent):
    """Attraction, repulsion and alignment (Reynolds 1987) from neighbours' beacons, avoidance by proximity.

    Each neighbour received since the last step pulls along its bearing if it is farther than `separation_m` and pushes
    if it is nearer, in proportion to the relative difference, at most 1 either way; its heading against the own compass
    adds a unit vector. Both are averaged over the neighbours received. The rays push away from what is near. The robot
    turns towards the sum, and drives the slower the more it has to turn.
    """

    needs: ClassVar[tuple[str, ...]] = ("proximity", "compass", "radio.range", "radio.bearing")
    speed_mps: float = 0.1  # straight ahead
    separation_m: float = 0.4  # distance between neighbours at which nothing pulls or pushes
    cohesion: float = 0.6  # weight of attraction and repulsion
    alignment: float = 1.0  # weight of the neighbours' mean heading
    avoidance: float = 3.0  # weight of the rays
    forward: float = 0.3  # weight of the way ahead, against dithering
    turn_gain_per_s: float = 2.0  # turn rate per angle to the wanted direction

    @classmethod
    def check_parameters(cls, params: Mapping[str, Any], robots: int) -> None:
        """Distances are in units of one."""
        check_above_zero(params, "separation_m")

    def step(self, robots: Robots, memory: Memory) -> None:
        """Steer to the sum of all pulls, and broadcast the heading."""
        heading = robots.compass.heading_rad
        received = robots.radio.received(Heading)
        pull = self.cohesion * spacing(received.range_m, received.bearing_rad, self.separation_m)
        turn = self.alignment * alignment(received.message.heading_rad, heading[received.row])
        near = self.avoidance * repulsion_of_rays(robots.proximity)
        wanted = self.forward * ahead(robots.n) + mean_received(received, pull + turn) + near
        robots.drive(*steered(wanted, self.speed_mps, self.turn_gain_per_s))
        robots.radio.send(Heading, heading_rad=heading)

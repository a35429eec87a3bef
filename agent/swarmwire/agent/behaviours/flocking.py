"""Flocking over the radio: robots broadcast their headings; cohesion, separation and alignment."""

from collections.abc import Mapping
from typing import Any, ClassVar

from swarmwire.agent.behaviours._common import check_above_zero
from swarmwire.agent.fields import ahead, alignment, mean_received, repulsion_of_rays, spacing, steered
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import Memory, VectorAgent
from swarmwire.comms.robot.messages import Message, f4


class Heading(Message):
    """A robot's heading, broadcast in every step."""

    heading_rad: f4  # reading of the compass


class Flocking(VectorAgent):
    """Attraction, repulsion and alignment (Reynolds 1987) by neighbours' beacons, and avoidance by proximity rays.

    Each neighbour received since the last step attracts along its bearing if it is farther than `separation_m`, and
    repels if it is nearer, in proportion to the relative difference, at most 1 either way; its heading relative to the
    robot's adds a unit vector. Both are averaged over the received neighbours. The rays repel from near objects. The
    robot turns towards the sum, and drives more slowly the more it has to turn.
    """

    needs: ClassVar[tuple[str, ...]] = ("proximity", "compass", "radio.range", "radio.bearing")
    speed_mps: float = 0.1  # straight ahead
    separation_m: float = 0.4  # distance between neighbours without attraction and repulsion
    cohesion: float = 0.6  # weight of attraction and repulsion
    alignment: float = 1.0  # weight of the neighbours' mean heading
    avoidance: float = 3.0  # weight of the rays
    forward: float = 0.3  # weight of the direction ahead, against dithering
    turn_gain_per_s: float = 2.0  # turn rate per angle to the sum

    @classmethod
    def check_parameters(cls, params: Mapping[str, Any], robots: int) -> None:
        """Refuse a separation of 0, which is the unit of distances."""
        check_above_zero(params, "separation_m")

    def step(self, robots: Robots, memory: Memory) -> None:
        """Steer along the sum of the fields, and broadcast the heading."""
        heading = robots.compass.heading_rad
        received = robots.radio.received(Heading)
        cohesion = self.cohesion * spacing(received.range_m, received.bearing_rad, self.separation_m)
        align = self.alignment * alignment(received.message.heading_rad, heading[received.row])
        avoidance = self.avoidance * repulsion_of_rays(robots.proximity)
        field = self.forward * ahead(robots.n) + mean_received(received, cohesion + align) + avoidance
        robots.drive(*steered(field, self.speed_mps, self.turn_gain_per_s))
        robots.radio.send(Heading, heading_rad=heading)

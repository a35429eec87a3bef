"""Flocking over the radio: robots broadcast their headings; cohesion, separation and alignment."""

from typing import ClassVar

from swarmwire.agent.fields import ahead, alignment, mean_received, repulsion_of_rays, spacing, steered
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import Memory, VectorAgent
from swarmwire.comms.base.config import parameter
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
    speed_mps: float = parameter(0.1, help="straight ahead")
    separation_m: float = parameter(0.4, help="distance between neighbours without attraction and repulsion", above=0.0)
    cohesion: float = parameter(0.6, help="weight of attraction and repulsion")
    alignment: float = parameter(1.0, help="weight of the neighbours' mean heading")
    avoidance: float = parameter(3.0, help="weight of the rays")
    forward: float = parameter(0.3, help="weight of the direction ahead, against dithering")
    turn_gain_per_s: float = parameter(2.0, help="turn rate per angle to the sum")

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

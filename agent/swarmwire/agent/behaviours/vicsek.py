"""The model of Vicsek et al. (1995): each particle moves in the mean direction of its neighbours, with noise."""

from typing import ClassVar

import numpy as np

from swarmwire.agent import portable
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import Memory, VectorAgent
from swarmwire.comms.base.angles import wrap_by_modulo
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.config import parameter
from swarmwire.comms.robot.messages import Message, f8


class Direction(Message):
    """A particle's direction, broadcast in every step."""

    heading_rad: f8  # direction until the next step, in the frame of the compass


class Vicsek(VectorAgent):
    """Vicsek's model: particles of one speed move in the mean direction of their neighbourhood, with noise.

        theta(t + 1) = angle of the mean of (cos theta, sin theta) over particle and neighbours + U(-eta/2, eta/2)
        x(t + 1) = x(t) + v (cos theta(t), sin theta(t)) dt

    with the time dt between two steps. Neighbours are the senders of the packets received since the last step. A step
    equals a step of the model if packets are received one step after they were sent (`send_offset = "tick"`, no
    latency), none is lost, and the body can turn by pi within a step (a holonomic drive, such as that of `point` at up
    to 2 Hz). The body's heading at the end of a step is the direction of that step.

    Source: T. Vicsek et al., Novel type of phase transition in a system of self-driven particles, PRL 75 (1995), with
    v dt = 0.03 of the range. The paper does not treat late or lost packets: here a late packet counts when it is
    received, and a lost one does not count. A particle's own direction is its reading of the compass.
    """

    needs: ClassVar[tuple[str, ...]] = ("compass",)
    speed_mps: float = parameter(0.03, help="speed v, constant and the same for all particles")
    noise_rad: float = parameter(1.0, help="width eta of the uniform distribution of a step's noise")

    def step(self, robots: Robots, memory: Memory) -> None:
        """Compute the next direction, move along it, and broadcast it."""
        heading = robots.compass.heading_rad
        received = robots.radio.received(Direction)
        x = portable.cos(heading) + received.sum(portable.cos(received.message.heading_rad))
        y = portable.sin(heading) + received.sum(portable.sin(received.message.heading_rad))
        half = 0.5 * self.noise_rad
        direction = portable.atan2(y, x) + robots.draw.uniform("noise of the direction", -half, half)
        self._move(robots, wrap_by_modulo(direction - heading))
        robots.radio.send(Direction, heading_rad=direction)

    def _move(self, robots: Robots, turn: FloatArray) -> None:
        """Move by v dt in the direction `turn` (n,), in rad to the left of the heading, and turn to it meanwhile.

        A body that turns while it drives moves on an arc. The chord, of length v dt, is shorter than the arc, and lies
        half the turn to the side of the first direction of motion.
        """
        half = 0.5 * turn
        arc = self.speed_mps * np.divide(half, portable.sin(half), out=np.ones_like(half), where=half != 0.0)
        robots.drive(
            linear_mps=arc * portable.cos(half),
            lateral_mps=arc * portable.sin(half),
            angular_radps=turn / robots.period_s,
        )

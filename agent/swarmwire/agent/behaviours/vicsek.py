"""Vicsek's self-driven particles: each takes the mean direction of its neighbours, with noise."""

from typing import ClassVar

import numpy as np

from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import Memory, VectorAgent
from swarmwire.comms.base.angles import wrap_by_modulo
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.robot.messages import Message, f8


class Direction(Message):
    """Where a particle goes, as it says in every step."""

    heading_rad: f8  # in the frame of the compass, from this step to the next


class Vicsek(VectorAgent):
    """Vicsek's model: each goes the mean way of its neighbours, itself included, with noise, all equally fast.

        theta(t + 1) = angle of the mean of (cos theta, sin theta) over oneself and who is received + U(-eta/2, eta/2)
        x(t + 1) = x(t) + v (cos theta(t), sin theta(t)) dt

    dt is the time between two steps, and neighbours are those in range of the radio when they sent. A step is one of
    the model where a packet is received one step after it was sent (`send_offset = "tick"`, no latency), nothing is
    lost, and the body can turn by pi within a step (a holonomic drive, as of `point` at up to 2 Hz). The body comes to
    look where it goes: its heading at the end of a step is the direction of that step.

    Source: T. Vicsek et al., Novel type of phase transition in a system of self-driven particles, PRL 75 (1995), with
    v dt = 0.03 of the range. Of packets late or lost it says nothing: here each is taken as received, who is not
    received in a step does not count in it, and one's own direction is the one that the compass shows.
    """

    needs: ClassVar[tuple[str, ...]] = ("compass",)
    speed_mps: float = 0.03  # v, of all at all times
    noise_rad: float = 1.0  # eta: a step's noise is uniform within half of this to either side

    def step(self, robots: Robots, memory: Memory) -> None:
        """Take the mean direction, say so, and go there."""
        own = robots.compass.heading_rad
        received = robots.radio.received(Direction)
        x = np.cos(own) + received.sum(np.cos(received.message.heading_rad))
        y = np.sin(own) + received.sum(np.sin(received.message.heading_rad))
        half = 0.5 * self.noise_rad
        wanted = np.arctan2(y, x) + robots.draw.uniform("noise of the direction", -half, half)
        self._go(robots, wrap_by_modulo(wanted - own))
        robots.radio.send(Direction, heading_rad=wanted)

    def _go(self, robots: Robots, turn: FloatArray) -> None:
        """Move straight by v dt to `turn` (n,) rad left of the body, which turns there meanwhile.

        A body that turns while it drives runs an arc, whose chord lies half the turn off the way that it set out on,
        and is shorter than the arc.
        """
        arc = self.speed_mps / np.sinc(turn / (2.0 * np.pi))
        robots.drive(
            linear_mps=arc * np.cos(0.5 * turn),
            lateral_mps=arc * np.sin(0.5 * turn),
            angular_radps=turn / robots.period_s,
        )

"""Average consensus: robots agree on a number over the radio."""

from typing import ClassVar

import numpy as np

from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import FloatColumn, Memory, PerRobot, VectorAgent, column, per_robot
from swarmwire.comms.robot.messages import Message, f8


class Value(Message):
    """The number that a robot has come to."""

    value: f8


class Estimate(Memory):
    """What a robot takes the average to be."""

    value: FloatColumn = column(np.nan)  # none yet


class Consensus(VectorAgent[Estimate]):
    """Average consensus: each robot moves its number towards those that it hears, until all have the same.

        x_i <- x_i + gain x sum over packets received since the last step of (x_j - x_i)

    Every step ends with a broadcast of x_i, and records it as a note, so that `consensus_error` and `consensus_bias`
    can be measured. Robots stay where they are. With all links there and none delayed, all tend to the average of the
    first numbers if gain < 2 / (largest eigenvalue of the graph's Laplacian), for which gain < 1 / (most neighbours)
    is enough. Losses slow it, and since what one robot gives the other then does not take, the average moves.

    Source: R. Olfati-Saber, R. M. Murray, IEEE Transactions on Automatic Control 49 (9), 2004, in discrete time. Of
    losses it says nothing: here who is not received does not count, and a number that comes late counts as it is.
    """

    needs: ClassVar[tuple[str, ...]] = ()
    gain: float = 0.1  # share of the difference to each neighbour that is taken up in a step
    start: PerRobot[float] = per_robot(0.0)  # x_i at first, or the middle of what it is drawn from
    start_width: float = 0.0  # x_i at first is uniform within half of this to either side of start

    def step(self, robots: Robots, memory: Estimate) -> None:
        """Move towards what was received, and broadcast the result."""
        half = 0.5 * self.start_width
        first = self.start + robots.draw.uniform("first value", -half, half)
        own = np.where(np.isnan(memory.value), first, memory.value)
        received = robots.radio.received(Value)
        memory.value[:] = own + self.gain * received.sum(received.message.value - own[received.row])
        robots.note(value=memory.value)
        robots.radio.send(Value, value=memory.value)

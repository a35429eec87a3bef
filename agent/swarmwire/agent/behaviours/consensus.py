"""Average consensus: robots agree on a number over the radio."""

from typing import ClassVar

import numpy as np

from swarmwire.agent.parameters import PerRobot
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import FloatColumn, Memory, VectorAgent, column
from swarmwire.comms.base.config import parameter
from swarmwire.comms.robot.messages import Message, f8


class Value(Message):
    """A robot's number, broadcast in every step."""

    value: f8


class Estimate(Memory):
    """A robot's estimate of the average."""

    value: FloatColumn = column(np.nan)  # nan before the first step


class Consensus(VectorAgent[Estimate]):
    """Average consensus: each robot moves its number towards received numbers, until all agree.

        x_i <- x_i + gain sum (x_j - x_i)    over the packets received since the last step

    Every step broadcasts x_i, and notes it for the metrics `consensus_error` and `consensus_bias`. Robots do not move.
    With all links up and none delayed, all numbers tend to the average of the first ones if gain < 2 / (largest
    eigenvalue of the graph's Laplacian), for which gain < 1 / (largest number of neighbours) is sufficient. Losses slow
    the agreement down, and shift the average, since updates are then no longer symmetric.

    Source: R. Olfati-Saber, R. M. Murray, IEEE Transactions on Automatic Control 49 (9), 2004, in discrete time. The
    paper does not treat losses: here a lost number does not count, and a late one counts unchanged.
    """

    needs: ClassVar[tuple[str, ...]] = ()
    gain: float = parameter(0.1, help="share of the difference to each neighbour by which x_i moves in a step")
    start: PerRobot[float] = parameter(0.0, help="first x_i, or the middle of its distribution")
    start_width: float = parameter(0.0, help="width of the uniform distribution of the first x_i around start")

    def step(self, robots: Robots, memory: Estimate) -> None:
        """Move towards the received numbers, and broadcast the result."""
        half = 0.5 * self.start_width
        first = self.start + robots.draw.uniform("first value", -half, half)
        value = np.where(np.isnan(memory.value), first, memory.value)
        received = robots.radio.received(Value)
        memory.value[:] = value + self.gain * received.sum(received.message.value - value[received.row])
        robots.note(value=memory.value)
        robots.radio.send(Value, value=memory.value)

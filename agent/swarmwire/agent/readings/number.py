"""What a reading has of a robot where it has a single number."""

from typing import TypeVar

from swarmwire.comms.arrays import FloatArray

N = TypeVar("N", bound=float | FloatArray)  # a float for an Agent; (n,) for a VectorAgent, one for each robot

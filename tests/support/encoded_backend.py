"""An agent backend in this process that encodes and decodes every frame, as runners behind zenoh do.

The robots are split among `runners` parts. Each part is the protocol code of a runner, fed with bytes; the world's side
is the lockstep of real runs. Only zenoh and the processes are missing. Answers arrive in another order in every tick.
"""

from functools import partial

import numpy as np

from swarmwire.comms.assignment import Assignment
from swarmwire.comms.packets import NO_TX_STATUSES, ReceivedPackets, TxStatuses
from swarmwire.comms.tick_io import Actions, Readings
from swarmwire.world.backends.allocation import split
from swarmwire.world.backends.lockstep import Lockstep
from tests.support.agent.runners import EncodedRunner


class EncodedBackend:
    """A AgentBackend of `runners` runners in this process."""

    def __init__(self, assignment: Assignment, runners: int = 3, *, backwards: bool = False) -> None:
        """`backwards` gives the first runner the last robots."""
        parts = split(assignment, runners)
        self._lockstep = Lockstep(parts[::-1] if backwards else parts)
        self._runners: dict[str, EncodedRunner] = {}
        self._order = np.random.default_rng(1)
        self._parts = len(parts)

    def start(self) -> None:
        """Let each runner join, decode its robots and make its agents."""
        for number in range(self._parts):
            name = f"r{number}"
            runner = self._runners[name] = EncodedRunner(partial(self._lockstep.join, name))
            self._lockstep.answer(name, runner.ready)

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """One frame to every runner, one answer from each, in a random order."""
        answered: list[tuple[str, bytes]] = []
        for name, data in self._lockstep.open_tick(tick, readings, received, tx_status):
            answered.append((name, self._runners[name].answer(data)))
        for at in self._order.permutation(len(answered)):
            self._lockstep.answer(*answered[at])
        return self._lockstep.take()

    def counts(self) -> dict[str, int]:
        """Frames that were refused, by fault."""
        return self._lockstep.counts()

    def close(self) -> None:
        """Forget the agents."""
        self._runners.clear()

"""The gateway of robots that are elsewhere: their agents, with drivers of their own, use the run's radio alone."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.robot.tick_io import NOTHING_SET
from swarmwire.world.gateways.gateway import FRESH, ForeignCommands, Gateway


class RadioOnlyGateway(Gateway):
    """Robots elsewhere, real or of another run: this run lends them its radio, and emulates no robot to drive."""

    sensors: ClassVar[frozenset[str]] = frozenset()

    def differences(self) -> tuple[str, ...]:
        """Return none: no robot is emulated."""
        return ()

    def open(self) -> tuple[str, ...]:
        """Return no address for any robot; BadInput if one was given."""
        if self.address:
            raise BadInput("gateways", "address", f"expected none: the robots are elsewhere; got {self.address!r}")
        return ("",) * len(self.names)

    def publish(
        self, time_ns: int, fields: dict[str, FloatArray], alive: BoolArray, ages_ns: Mapping[str, int] = FRESH
    ) -> None:
        """Do nothing: the robots have sensors of their own."""

    def pop_commands(self) -> ForeignCommands:
        """Return no commands."""
        none = np.zeros(len(self.names))
        return ForeignCommands(none > 0.0, none, none, none, NOTHING_SET)

    def counts(self) -> dict[str, int]:
        """Return none."""
        return {}

    def close(self) -> None:
        """Do nothing."""

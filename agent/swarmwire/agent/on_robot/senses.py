"""What a robot's agent senses: from the driver, and from a tracker what the driver does not give."""

from collections.abc import Callable
from math import isfinite, nan

import numpy as np

from swarmwire.agent.drivers.driver import Driver
from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.wire.radio_bridge import Pose

NOT_SEEN = Pose(nan, nan, nan)  # as emulated senses read when a reading is lost
BATTERY = "battery"


class SensesOnRobot:
    """The senses that the agent needs, and the battery for whoever looks on, if the driver tells it.

    Attributes:
        pose: where the tracker saw the robot at the last reading; None: it did not, or there is no tracker.
        charge: the last charge of the battery, 0 to 1; None if it is not known.
        complete: whether there was a reading in which no sense was lost whole, the battery left out.
    """

    def __init__(
        self, driver: Driver, needs: frozenset[str], tracked: frozenset[str], own_pose: Callable[[], Pose | None]
    ) -> None:
        self._driver, self._tracked, self._own_pose = driver, tracked, own_pose
        self._asked = ((needs - tracked) | {BATTERY}) & driver.gives
        self.pose: Pose | None = None
        self.charge: float | None = None
        self.complete = False

    def read(self) -> dict[str, FloatArray]:
        """The fields of the senses, a row each; DriverLost if the robot does not answer."""
        fields = self._driver.sense(self._asked)
        if BATTERY in self._asked:
            charge = float(fields["battery.charge"][0])
            self.charge = charge if isfinite(charge) else None
        self.pose = self._own_pose()
        x_m, y_m, heading_rad = self.pose or NOT_SEEN
        if "positioning" in self._tracked:
            fields |= {"positioning.x_m": np.array([x_m]), "positioning.y_m": np.array([y_m])}
        if "compass" in self._tracked:
            fields["compass.heading_rad"] = np.array([heading_rad])
        if not self.complete:
            lost = [name for name, column in fields.items() if np.isnan(column).all()]
            self.complete = all(name.startswith(f"{BATTERY}.") for name in lost)
        return {name: _read_only(column) for name, column in fields.items()}


def _read_only(column: FloatArray) -> FloatArray:
    """As in emulation: a reading is the driver's, and no agent writes to it."""
    view = column.view()
    view.flags.writeable = False
    return view

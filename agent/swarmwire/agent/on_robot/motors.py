"""The motors of a robot, behind the emergency stop and the loss of the driver."""

from swarmwire.agent.drivers.driver import Command, Driver, DriverLost
from swarmwire.agent.on_robot.control import Control

OUT_OF_REACH = "the robot is out of reach, and may go on as it was told last"


class Motors:
    """Hands commands to the driver unless the emergency stop is latched; `stop` may be called from any thread.

    Attributes:
        reachable: whether the robot answered when it was last asked for something; the loop knows.
    """

    def __init__(self, driver: Driver) -> None:
        self._driver = driver
        self.control = Control(self._stop_or_tell)
        self.reachable = True

    def act(self, command: Command) -> None:
        """Hand a command to the robot; DriverLost if it cannot be. Nothing moves after an emergency stop."""
        if self.control.stopped:
            return
        self._driver.act(command)
        if self.control.stopped:  # it came while the command was on its way, and may have been overtaken
            self._driver.stop()

    def stop(self) -> None:
        """Motors off at once. A robot that cannot be reached is stopped first of all when it can be."""
        try:
            self._driver.stop()
        except DriverLost:
            return

    def _stop_or_tell(self) -> None:
        """Motors off at once; DriverLost if the robot cannot be reached, so that nobody believes that it stands."""
        self._driver.stop()
        if not self.reachable:
            raise DriverLost(OUT_OF_REACH)

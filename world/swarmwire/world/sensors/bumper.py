"""The bumper: whether the body touched anything in the tick before."""

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.sensors import Bumper
from swarmwire.comms.truth import Group
from swarmwire.world.sensors.scene import Scene
from swarmwire.world.sensors.sensor import Field


class BumperSensor:
    """Sense `bumper`: pressed (n,), 1 if the body touched a robot, an obstacle or a wall in the tick before, else 0."""

    def __init__(self, scene: Scene, group: Group, sheet: Bumper) -> None:
        self._scene, self._group = scene, group
        self.fields = (Field("pressed", blank=0.0),)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """Which robots of the group touched anything."""
        return (self._scene.touched[:, self._group.start : self._group.stop].copy(),)

"""Passive infrared: rays from the rim that end at the nearest robot alive, unless something stands before it."""

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.sensors import Infrared
from swarmwire.comms.truth import Group
from swarmwire.world.sensors.fan import FanSight
from swarmwire.world.sensors.scene import Scene
from swarmwire.world.sensors.sensor import Field, Noise


class InfraredSensor:
    """Sense `infrared`: value (n, rays), the answers to other robots' light, 0 to 1. Noise is uniform."""

    def __init__(self, scene: Scene, group: Group, sheet: Infrared) -> None:
        self._sight = FanSight(scene, group, sheet, active=False)
        noise = Noise("uniform", sheet.noise)
        self.fields = (Field("value", len(sheet.angle_rad), noise, sheet.step, low=0.0, high=1.0, blank=0.0),)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """What every ray of every robot of the group would answer without noise."""
        return (self._sight.answer(),)

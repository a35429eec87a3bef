"""Proximity: rays from the rim that end at the nearest robot, obstacle or wall, seen through the sensor's response."""

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.sensors import Proximity
from swarmwire.comms.truth import Group
from swarmwire.world.sensors.fan import FanSight
from swarmwire.world.sensors.scene import Scene
from swarmwire.world.sensors.sensor import Field, Noise


class ProximitySensor:
    """Sense `proximity`: value (n, rays), the sensors' answers, 0 to 1. Noise is uniform, and new in every reading."""

    def __init__(self, scene: Scene, group: Group, sheet: Proximity) -> None:
        self._sight = FanSight(scene, group, sheet, active=True)
        noise = Noise("uniform", sheet.noise)
        self.fields = (Field("value", len(sheet.angle_rad), noise, sheet.step, low=0.0, high=1.0, blank=0.0),)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """What every ray of every robot of the group would answer without noise."""
        return (self._sight.answer(),)

    def distance_m(self) -> FloatArray:
        """The true distance along each ray, (arenas, n, rays) in m; inf where nothing is within the range."""
        return self._sight.distance_m()

"""The compass: heading in the arena's frame, with a normal error that is new in every tick."""

from math import pi

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.sensors import Compass
from swarmwire.comms.truth import Group
from swarmwire.world.sensors.scene import Scene
from swarmwire.world.sensors.sensor import Field, Noise


class CompassSensor:
    """Sense `compass`: heading_rad (n,), in (-pi, pi], 0 along the arena's +x."""

    def __init__(self, scene: Scene, group: Group, sheet: Compass) -> None:
        self._scene, self._group = scene, group
        noise = Noise("normal", sheet.noise_rad)
        self.fields = (Field("heading_rad", noise=noise, step=sheet.step, angle=True, span=(-pi, pi)),)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """The heading of every robot of the group, with the full turns that it has made."""
        return (self._scene.state[:, self._group.start : self._group.stop, 2].copy(),)

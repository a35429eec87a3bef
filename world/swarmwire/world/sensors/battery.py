"""The battery's gauge: its charge, and a voltage that falls evenly with it."""

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.sensors import Battery
from swarmwire.comms.truth import Group
from swarmwire.world.sensors.scene import Scene
from swarmwire.world.sensors.sensor import Field, Noise


class BatterySensor:
    """Sense `battery`: charge (n,), 1 full to 0 empty, and voltage_v (n,)."""

    def __init__(self, scene: Scene, group: Group, sheet: Battery) -> None:
        self._scene, self._group, self._sheet = scene, group, sheet
        self.fields = (
            Field("charge", noise=Noise("normal", sheet.noise), step=sheet.step, low=0.0, high=1.0),
            Field("voltage_v", noise=Noise("normal", sheet.noise_v), low=0.0),
        )

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """Charge and voltage of every robot of the group."""
        charge = self._scene.charge[:, self._group.start : self._group.stop].copy()
        empty_v = self._sheet.empty_v
        return charge, empty_v + charge * (self._sheet.full_v - empty_v)

"""Positioning: where a robot is in the arena's frame, with a normal error that is new in every tick."""

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.sensors import Positioning
from swarmwire.comms.truth import Group
from swarmwire.world.sensors.scene import Scene
from swarmwire.world.sensors.sensor import Field, Noise


class PositioningSensor:
    """Sense `positioning`: x_m, y_m (n,), in m, arena frame. An outlier is anywhere in the arena."""

    def __init__(self, scene: Scene, group: Group, sheet: Positioning) -> None:
        self._scene, self._group = scene, group
        noise = Noise("normal", sheet.noise_m)
        self.fields = tuple(
            Field(name, noise=noise, step=sheet.step, span=(-0.5 * side_m, 0.5 * side_m))
            for name, side_m in zip(("x_m", "y_m"), scene.size_m, strict=True)
        )

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """The position of every robot of the group."""
        state = self._scene.state[:, self._group.start : self._group.stop]
        return state[:, :, 0].copy(), state[:, :, 1].copy()

"""The compass: heading in the arena's frame, with a normal error that is new in every tick."""

# pyright: basic, reportUnknownMemberType=false

from numba import njit

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.draws import purpose
from swarmwire.comms.draws_compiled import normal
from swarmwire.comms.sheets import Compass
from swarmwire.comms.truth import Group
from swarmwire.world.angles import wrapped
from swarmwire.world.sensors.scene import Scene

NOISE = purpose("compass noise")


class CompassSensor:
    """Sense `compass`: heading_rad (n,), in (-pi, pi], 0 along the arena's +x."""

    def __init__(self, scene: Scene, group: Group, sheet: Compass) -> None:
        self._scene, self._group, self._sheet = scene, group, sheet

    def read(self, tick: int) -> dict[str, FloatArray]:
        """The heading that every robot of the group reads in a tick."""
        heading = self._scene.state[:, self._group.start : self._group.stop, 2].copy()
        if self._sheet.noise_rad > 0.0:
            _add_noise(heading, self._scene.keys, self._group.start, tick, self._sheet.noise_rad)
        return {"compass.heading_rad": wrapped(heading.ravel())}


@njit(cache=True)
def _add_noise(heading, keys, start, tick, deviation):
    for arena in range(heading.shape[0]):
        for i in range(heading.shape[1]):
            heading[arena, i] += deviation * normal(keys[arena], start + i, tick, 0, NOISE)

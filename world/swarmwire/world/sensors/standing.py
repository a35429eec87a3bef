"""The obstacles of a scene as a sensor looks at them."""

from swarmwire.comms.geometry.obstacle_index import Things, things_within
from swarmwire.world.sensors.scene import Scene


class Standing:
    """The obstacles of a scene by cell, sorted once, or in each tick where some of them can be pushed."""

    def __init__(self, scene: Scene, reach_m: float, images_m: float | None = None) -> None:
        """For looking `reach_m` far; `images_m` as in `things_within`."""
        self._scene, self._reach_m, self._images_m = scene, reach_m, images_m
        self._things = self._sorted()

    def now(self) -> Things:
        """The obstacles where they stand in this tick; as many as ever."""
        if self._scene.obstacles_move:
            self._things = self._sorted()
        return self._things

    def _sorted(self) -> Things:
        scene = self._scene
        torus = scene.boundary == "torus"
        return things_within(scene.obstacles, scene.size_m, self._reach_m, torus, self._images_m)

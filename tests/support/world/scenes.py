"""Scenes made by hand, and sensors that look at them."""

from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.body import Body
from swarmwire.comms.geometry.ground import ground_of
from swarmwire.comms.geometry.obstacles import obstacle_arrays
from swarmwire.comms.sensors.sensor import SensorSpec
from swarmwire.comms.truth import Group, Obstacle
from swarmwire.world.sensors.loading import sensor_of
from swarmwire.world.sensors.pipeline import Staged
from swarmwire.world.sensors.sensor import Scene, led_places_m


def scene(poses: Any, body: Body, obstacles: tuple[Obstacle, ...] = (), size_m: float = 10.0, **more: Any) -> Scene:
    """One arena with robots of one body at these poses (robots, 3)."""
    robots = len(poses)
    boundary = more.get("boundary", "walls")
    state = np.zeros((1, robots, 6))
    state[0, :, :3] = poses
    return Scene(
        keys=np.array([7], np.uint64),
        size_m=(size_m, size_m),
        boundary=boundary,
        obstacles=obstacle_arrays((obstacles,)),
        lights=(more.get("lights", ()),),
        ground=ground_of(more.get("floor"), (size_m, size_m), boundary),
        tick_s=more.get("tick_s", 0.1),
        radius_m=np.full(robots, body.radius_m),
        bottom_m=np.zeros(robots),
        top_m=np.full(robots, body.height_m),
        state=state,
        travel_m=np.zeros((1, robots, 2)),
        touched=np.zeros((1, robots)),
        target=np.zeros((1, robots, 3)),
        alive=np.array([more.get("alive", [True] * robots)]),
        running=np.ones(1, np.bool_),
        charge=np.ones((1, robots)),
        leds=np.full((1, robots, body.led_count), more.get("colour", 0)),
        led_places_m=led_places_m((Group("a", body, 0, robots),), body.led_count),
    )


def staged(looked_at: Scene, body: Body, name: str, spec: SensorSpec) -> Staged:
    """A sense of all robots of a scene, by this sheet, with all its stages."""
    group = Group("a", body, 0, looked_at.state.shape[1])
    return Staged(name, sensor_of(name, spec, looked_at, group), spec, looked_at.keys, group, looked_at.tick_s)


def read(looked_at: Scene, body: Body, name: str, spec: SensorSpec, tick: int = 0) -> dict[str, FloatArray]:
    """What the robots of a scene read in a tick."""
    return staged(looked_at, body, name, spec).read(tick)

"""An arena, its robots and the packets between them as MarkerArrays, which Foxglove and rviz draw."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from math import isfinite
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.observe.truth import Static
from swarmwire.comms.protocols.ros2.messages import Messages
from swarmwire.comms.protocols.ros2.motion import FramePose, quaternion
from swarmwire.comms.robot.packets import FATE_NAMES, Fate
from swarmwire.metrics.measures.torus import shortest_displacement
from swarmwire.metrics.pictures.drawing.canvas import DEAD, FATE_COLORS, Color, rgb, robot_color
from swarmwire.metrics.pictures.drawing.packets import REACHED

MARKERS = "visualization_msgs/msg/MarkerArray"
MAP = "map"  # the frame of the arena
IN_MAP = FramePose(MAP, "")
ARROW, CUBE, SPHERE, CYLINDER, LINE_LIST, TRIANGLE_LIST = 0, 1, 2, 3, 5, 11  # types of a marker

FLOOR: Color = (43, 47, 54)
WALL: Color = (120, 126, 138)
OBSTACLE: Color = (150, 156, 168)
MOVABLE: Color = (198, 160, 96)
LIGHT: Color = (255, 210, 63)
HEADING: Color = (240, 242, 246)
WALL_ROBOTS = 2.0  # height of walls, and of obstacles without a top, in heights of the tallest robot
FLOOR_M = 0.01  # thickness of floor and walls


@dataclass(frozen=True)
class Mark:
    """The fields of a marker that are in use."""

    kind: int
    color: Color
    scale_m: tuple[float, float, float]
    pose: FramePose = IN_MAP  # in its parent
    namespace: str = ""
    points_m: AnyArray | None = None  # (k, 3)
    lifetime_ns: int = 0  # 0: until it is replaced
    follows: bool = False  # it moves with its frame


def marker_array(messages: Messages, marks: Sequence[Mark], stamp_ns: int) -> Any:
    """Return the message of some marks; their numbers count within each namespace."""
    numbers: defaultdict[str, Iterator[int]] = defaultdict(count)
    return messages.make(MARKERS, [_marker(messages, mark, next(numbers[mark.namespace]), stamp_ns) for mark in marks])


def _marker(messages: Messages, mark: Mark, number: int, stamp_ns: int) -> Any:
    make, pose, seconds = messages.make, mark.pose, divmod(mark.lifetime_ns, NS_PER_S)
    points = [] if mark.points_m is None else [make("geometry_msgs/msg/Point", *row) for row in mark.points_m.tolist()]
    position = make("geometry_msgs/msg/Point", pose.x_m, pose.y_m, pose.z_m)
    no_bytes = np.empty(0, np.uint8)
    return make(
        "visualization_msgs/msg/Marker",
        messages.header(stamp_ns, pose.parent),
        mark.namespace,
        number,
        mark.kind,
        0,  # add, or replace the marker of this namespace and number
        make("geometry_msgs/msg/Pose", position, quaternion(messages, pose.yaw_rad)),
        make("geometry_msgs/msg/Vector3", *mark.scale_m),
        make("std_msgs/msg/ColorRGBA", *rgb(mark.color), 1.0),
        make("builtin_interfaces/msg/Duration", *seconds),
        mark.follows,
        points,
        [],  # one colour for all points
        "",
        make("sensor_msgs/msg/CompressedImage", messages.header(0, ""), "", no_bytes),
        [],
        "",
        "",
        make("visualization_msgs/msg/MeshFile", "", no_bytes),
        False,
    )


class Scenery:
    """Floor, walls, obstacles and lights of an arena."""

    def __init__(self, static: Static, arena: int) -> None:
        self._static, self._arena = static, arena
        self._height_m = WALL_ROBOTS * max(group.body.height_m for group in static.groups)

    def fixed(self) -> list[Mark]:
        """Return the marks of what does not move."""
        width_m, depth_m = self._static.arena_size_m
        floor = FramePose(MAP, "", z_m=-FLOOR_M)
        marks = [Mark(CUBE, FLOOR, (width_m, depth_m, FLOOR_M), floor, "floor")]
        if self._static.walled:
            across, along = (FLOOR_M, depth_m + 2.0 * FLOOR_M, self._height_m), (width_m, FLOOR_M, self._height_m)
            for side in (-0.5, 0.5):
                x_m, y_m = side * (width_m + FLOOR_M), side * (depth_m + FLOOR_M)
                marks += [
                    Mark(CUBE, WALL, across, FramePose(MAP, "", x_m=x_m, z_m=0.5 * self._height_m), "walls"),
                    Mark(CUBE, WALL, along, FramePose(MAP, "", y_m=y_m, z_m=0.5 * self._height_m), "walls"),
                ]
        marks += [self._obstacle(obstacle, OBSTACLE) for obstacle in self._static.fixed(self._arena)]
        lights = self._static.lights[self._arena] if self._static.lights else ()
        diameter_m = 0.5 * self._height_m
        for light in lights:
            pose = FramePose(MAP, "", light.x_m, light.y_m, z_m=self._height_m)
            marks.append(Mark(SPHERE, LIGHT, (diameter_m, diameter_m, diameter_m), pose, "lights"))
        return marks

    def movable(self, pose: AnyArray) -> list[Mark]:
        """Return the marks of the obstacles that robots push, at poses (k, 3)."""
        return [self._obstacle(obstacle, MOVABLE) for obstacle in self._static.movable_at(self._arena, pose)]

    def _obstacle(self, obstacle: Obstacle, color: Color) -> Mark:
        height_m = obstacle.height_m if isfinite(obstacle.height_m) else self._height_m
        if obstacle.shape == "polygon":
            return Mark(
                TRIANGLE_LIST,
                color,
                (1.0, 1.0, 1.0),
                namespace="obstacles",
                points_m=_prism(obstacle.corners_m, height_m),
            )
        pose = FramePose(MAP, "", obstacle.x_m, obstacle.y_m, obstacle.heading_rad, 0.5 * height_m)
        if obstacle.shape == "box":
            return Mark(CUBE, color, (*obstacle.size_m, height_m), pose, "obstacles")
        diameter_m = 2.0 * obstacle.radius_m
        return Mark(CYLINDER, color, (diameter_m, diameter_m, height_m), pose, "obstacles")


def _prism(corners_m: FloatArray, height_m: float) -> FloatArray:
    """Return the triangles (3 k, 3) of top and sides over convex, counter-clockwise corners (n, 2)."""
    low, high = (np.column_stack([corners_m, np.full(len(corners_m), z_m)]) for z_m in (0.0, height_m))
    following, above = np.roll(low, -1, axis=0), np.roll(high, -1, axis=0)
    top = np.stack([np.broadcast_to(high[0], (len(high) - 2, 3)), high[1:-1], high[2:]], axis=1)
    sides = np.concatenate([np.stack([low, following, above], axis=1), np.stack([low, above, high], axis=1)])
    return np.concatenate([top, sides]).reshape(-1, 3)


def body_marks(static: Static, frames: Sequence[str], alive: BoolArray) -> list[Mark]:
    """Return a cylinder and an arrow ahead per robot, in its frame; dead robots are grey."""
    return list(_bodies(static, frames, alive.tolist()))


def _bodies(static: Static, frames: Sequence[str], alive: Sequence[bool]) -> Iterator[Mark]:
    for number, group in enumerate(static.groups):
        width_m, height_m = 2.0 * group.body.radius_m, group.body.height_m
        for robot in range(group.start, group.stop):
            color = robot_color(number) if alive[robot] else DEAD
            center, top = (FramePose(frames[robot], "", z_m=z_m) for z_m in (0.5 * height_m, height_m))
            yield Mark(CYLINDER, color, (width_m, width_m, height_m), center, "bodies", follows=True)
            yield Mark(ARROW, HEADING, (0.8 * width_m, 0.1 * width_m, 0.1 * width_m), top, "headings", follows=True)


def packet_marks(
    static: Static, position_m: FloatArray, ends: IntArray, fate: IntArray, lifetime_ns: int
) -> list[Mark]:
    """Return the lines of packets between senders and receivers (k, 2) at positions (n, 3), a mark per fate (k,).

    A packet that was not received reaches only a part of the way. A line across the seam of a torus leaves the arena.
    """
    start = position_m[ends[:, 0]]
    way = position_m[ends[:, 1]] - start
    way[:, :2] = shortest_displacement(way[:, :2], static)
    way[fate != Fate.RECEIVED] *= REACHED
    lines = np.stack([start, start + way], axis=1)
    width_m = max(0.2 * min(group.body.radius_m for group in static.groups), 0.001 * max(static.arena_size_m))
    return [
        Mark(
            LINE_LIST,
            FATE_COLORS[Fate(number)],
            (width_m, 0.0, 0.0),
            namespace=FATE_NAMES[number],
            points_m=lines[fate == number].reshape(-1, 3),
            lifetime_ns=lifetime_ns,
        )
        for number in map(int, np.unique(fate))
    ]

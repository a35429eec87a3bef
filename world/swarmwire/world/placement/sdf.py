"""Boxes and cylinders of an SDF world or model (sdformat.org), as obstacles.

An obstacle comes from each <collision> of a static model: poses of world, nested models, links and collisions are
applied one after the other. What is no upright box or cylinder on the floor is counted by kind.
"""

from collections import Counter
from math import pi
from typing import NamedTuple
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.geometry.shapes import Obstacle

UPRIGHT = 1e-6  # sine of the greatest tilt
FLOOR_M = 1e-3  # lower sides above this leave a gap to the floor


MAX_NUMBER = 1e9
MAX_DEPTH = 100

Vector = tuple[float, float, float]


class SdfFrame(NamedTuple):
    """A pose in the world: the rows of the rotation, and the position in m."""

    rotation: tuple[Vector, Vector, Vector]
    position_m: Vector

    def turn(self, vector: Vector) -> Vector:
        """Return a vector of this frame in the world's axes."""
        x, y, z = (row[0] * vector[0] + row[1] * vector[1] + row[2] * vector[2] for row in self.rotation)
        return x, y, z

    def compose(self, inner: "SdfFrame") -> "SdfFrame":
        """Return a frame within this one as a frame of the world."""
        x, y, z = (self.turn((inner.rotation[0][i], inner.rotation[1][i], inner.rotation[2][i])) for i in range(3))
        moved = self.turn(inner.position_m)
        at_m = self.position_m[0] + moved[0], self.position_m[1] + moved[1], self.position_m[2] + moved[2]
        return SdfFrame(((x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2])), at_m)


WORLD = SdfFrame(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), (0.0, 0.0, 0.0))


def read_models(text: str, where: str) -> tuple[tuple[Obstacle, ...], Counter[str]]:
    """Return the obstacles of a text, and the number of things that are none, by kind; BadInput unless it is SDF."""
    try:
        root = ET.fromstring(text)
    except ET.ParseError as error:
        raise BadInput(where, "", f"expected XML: {error}") from None
    if root.tag != "sdf":
        raise BadInput(where, root.tag, "expected <sdf>")
    obstacles: list[Obstacle] = []
    left_out: Counter[str] = Counter()
    for parent in [root, *root.iterfind("world")]:
        left_out["include"] += len(parent.findall("include"))
        for model in parent.iterfind("model"):
            if model.findtext("static", "false").strip() in ("true", "1"):
                _add_model(model, WORLD, where, obstacles, left_out)
            else:
                left_out["model that is not static"] += 1
    return tuple(obstacles), +left_out


def _add_model(
    model: Element, frame: SdfFrame, where: str, obstacles: list[Obstacle], left_out: Counter[str], depth: int = 1
) -> None:
    """Add the obstacles of a static model and of the models in it."""
    inner = _posed(model, frame, where, left_out)
    left_out["include"] += len(model.findall("include"))
    if inner is None:
        return
    for link in model.iterfind("link"):
        link_frame = _posed(link, inner, where, left_out)
        for collision in link.iterfind("collision") if link_frame else ():
            assert link_frame is not None
            if (placed := _posed(collision, link_frame, where, left_out)) is not None:
                _add_collision(collision, placed, where, obstacles, left_out)
    for nested in model.iterfind("model"):
        if depth == MAX_DEPTH:
            raise BadInput(where, "model", f"expected at most {MAX_DEPTH} models within one another")
        _add_model(nested, inner, where, obstacles, left_out, depth + 1)


def _posed(element: Element, frame: SdfFrame, where: str, left_out: Counter[str]) -> SdfFrame | None:
    """Return the frame of an element within that of its parent; None, counted, if its pose refers to another one."""
    pose = element.find("pose")
    if pose is None:
        return frame
    is_relative = pose.get("relative_to") or pose.get("frame")  # `frame` before SDF 1.7
    if is_relative or pose.get("rotation_format", "euler_rpy") != "euler_rpy":
        left_out["pose with relative_to or a quaternion"] += 1
        return None
    x, y, z, *angles = _numbers(pose.text, 6, where, "pose") if (pose.text or "").strip() else [0.0] * 6
    roll, pitch, yaw = (angle * pi / 180.0 if pose.get("degrees") == "true" else angle for angle in angles)
    cr, cp, cy = (portable.cos(angle) for angle in (roll, pitch, yaw))
    sr, sp, sy = (portable.sin(angle) for angle in (roll, pitch, yaw))
    rotation = (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )
    return frame.compose(SdfFrame(rotation, (x, y, z)))


def _add_collision(
    collision: Element, frame: SdfFrame, where: str, obstacles: list[Obstacle], left_out: Counter[str]
) -> None:
    geometry = collision.find("geometry")
    shape = next(iter(geometry), None) if geometry is not None else None
    if shape is None or shape.tag not in ("box", "cylinder"):
        kind = "geometry" if shape is None else shape.tag
        left_out[kind] += kind != "plane"  # the floor
        return
    if shape.tag == "box":
        *size_m, length_m = _lengths_m(shape.findtext("size"), 3, where, "size")
    else:
        size_m, length_m = [], _lengths_m(shape.findtext("length"), 1, where, "length")[0]
    x_m, y_m, z_m = frame.position_m
    if abs(frame.rotation[2][2]) < 1.0 - UPRIGHT**2:
        left_out[f"tilted {shape.tag}"] += 1
    elif z_m - 0.5 * length_m > FLOOR_M:
        left_out[f"{shape.tag} above the floor"] += 1
    elif z_m + 0.5 * length_m <= FLOOR_M:
        left_out[f"{shape.tag} below the floor"] += 1
    elif shape.tag == "box":
        heading_rad = float(portable.atan2(frame.rotation[1][0], frame.rotation[0][0]))
        obstacles.append(
            Obstacle("box", x_m, y_m, heading_rad, size_m=(size_m[0], size_m[1]), height_m=z_m + 0.5 * length_m)
        )
    else:
        radius_m = _lengths_m(shape.findtext("radius"), 1, where, "radius")[0]
        obstacles.append(Obstacle("cylinder", x_m, y_m, radius_m=radius_m, height_m=z_m + 0.5 * length_m))


def _numbers(text: str | None, count: int, where: str, key: str) -> list[float]:
    try:
        numbers = [float(word) for word in (text or "").split()]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(abs(number) <= MAX_NUMBER for number in numbers):
        raise BadInput(where, key, f"expected {count} numbers up to {MAX_NUMBER:g}, got {text!r}")
    return numbers


def _lengths_m(text: str | None, count: int, where: str, key: str) -> list[float]:
    lengths_m = _numbers(text, count, where, key)
    if min(lengths_m) <= 0.0:
        raise BadInput(where, key, f"expected lengths above 0 m, got {text!r}")
    return lengths_m

"""What a run tells once to whoever looks on, as a frame: names and types are those of `Scene`, checked on arrival."""

import zlib
from dataclasses import asdict, fields, is_dataclass
from math import inf, isfinite
from types import NoneType, UnionType
from typing import Any, Literal, cast, get_args, get_origin, get_type_hints

from swarmwire.comms.bodies.body import Body, body_from_mapping
from swarmwire.comms.errors import BadFrame, BadInput
from swarmwire.comms.geometry.floor import FloorImage
from swarmwire.comms.glimpse import Scene
from swarmwire.comms.truth import Obstacle, Static
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.frames import Frame

OBSERVED_VERSION = 1  # of the frames for observers
_MAY_BE_INFINITE = ".height_m"  # of an obstacle


def encode_scene(scene: Scene) -> bytes:
    """A `scene` frame."""
    return frames.encode("scene", -1, {}, {"version": OBSERVED_VERSION, "scene": asdict(scene)})


def decode_scene(frame: Frame) -> Scene:
    """The scene of a `scene` frame; BadFrame if it holds none, or one that contradicts itself."""
    check_version(frame, "scene")
    scene: Scene = _build(Scene, frame.values.get("scene"), "scene")
    _check(scene.static)
    if scene.selected not in scene.static.robot_names:
        raise BadFrame("malformed", "selected: expected one of the robots")
    return scene


def check_version(frame: Frame, kind: str) -> None:
    """Return if the frame is of this kind and of a version that is understood; BadFrame otherwise."""
    version = frame.values.get("version")
    if frame.kind != kind or type(version) is not int or version != OBSERVED_VERSION:
        raise BadFrame("malformed", f"{frame.kind} {version!r}: expected {kind} {OBSERVED_VERSION}")


def _check(static: Static) -> None:
    """Numbers of things that must agree, and values that are divided by."""
    starts = [0, *(group.stop for group in static.groups)]
    image = static.floor.image if static.floor else None
    faults = {
        "seeds: expected an arena": not static.seeds,
        "rate_hz: expected 1 or more": static.rate_hz < 1,
        "arena_size_m: expected more than 0": min(static.arena_size_m) <= 0,
        "obstacles: expected those of each arena": len(static.obstacles) != static.arenas,
        "obstacles: expected as many movable ones in each arena": len(set(map(_movable, static.obstacles))) > 1,
        "lights: expected those of each arena": len(static.lights) not in (0, static.arenas),
        "floor.image: expected a grey for each row and column": image is not None and not _is_whole(image),
        "groups: expected each robot in one": [group.start for group in static.groups] != starts[:-1]
        or starts != sorted(set(starts))
        or starts[-1] != static.robots,
        "act_every_ticks: expected 1 or more": any(group.act_every_ticks < 1 for group in static.groups),
    }
    for fault, found in faults.items():
        if found:
            raise BadFrame("malformed", fault)


def _movable(obstacles: tuple[Obstacle, ...]) -> int:
    return sum(obstacle.movable for obstacle in obstacles)


def _is_whole(image: FloorImage) -> bool:
    try:
        return min(image.grey.shape) > 0
    except (ValueError, zlib.error):
        return False


def _build(hint: Any, value: object, key: str) -> Any:
    """`value`, made of maps, lists and plain values, as the type that `hint` names."""
    if hint is Body:
        return _body(value, key)
    if is_dataclass(hint):
        return _record(cast("type[Any]", hint), value, key)
    if get_origin(hint) is tuple and isinstance(value, list | tuple):
        return _tuple(get_args(hint), cast("list[object]", value), key)
    if get_origin(hint) is UnionType:
        [inner] = [choice for choice in get_args(hint) if choice is not NoneType]
        return None if value is None else _build(inner, value, key)
    if hint is float and type(value) in (int, float):
        number = float(cast("float", value))
        if isfinite(number) or (number == inf and key.endswith(_MAY_BE_INFINITE)):
            return number
    elif get_origin(hint) is Literal:
        if value in get_args(hint):
            return value
    elif type(value) is hint:
        return value
    raise BadFrame("malformed", f"{key}: expected {hint}, got {str(value)[:40]}")


def _tuple(kinds: tuple[Any, ...], items: list[object], key: str) -> tuple[Any, ...]:
    if kinds[-1] is Ellipsis:
        kinds = (kinds[0],) * len(items)
    if len(items) != len(kinds):
        raise BadFrame("malformed", f"{key}: expected {len(kinds)} values")
    return tuple(_build(kind, item, f"{key}[{i}]") for i, (kind, item) in enumerate(zip(kinds, items, strict=True)))


def _record(kind: type[Any], value: object, key: str) -> Any:
    names = [field.name for field in fields(kind)]
    if type(value) is not dict or cast("dict[object, object]", value).keys() != set(names):
        raise BadFrame("malformed", f"{key}: expected a map of {', '.join(names)}")
    hints, given = get_type_hints(kind), cast("dict[str, object]", value)
    return kind(**{name: _build(hints[name], given[name], f"{key}.{name}") for name in names})


def _body(value: object, key: str) -> Body:
    if type(value) is not dict:
        raise BadFrame("malformed", f"{key}: expected a body")
    try:
        return body_from_mapping(cast("dict[str, Any]", value), where=key)
    except BadInput as error:
        raise BadFrame("malformed", str(error)) from error

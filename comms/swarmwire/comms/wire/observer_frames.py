"""Frames for live observers: a `scene` frame once, and a `truth` frame for each observed tick; checked on arrival.

A `scene` frame holds an `ObservedRun` as maps and lists with the names of its fields. A `truth` frame holds the arrays
and counts of an `ObservedTick`.
"""

import zlib
from dataclasses import MISSING, asdict, fields, is_dataclass
from math import inf, isfinite
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, cast, get_args, get_origin, get_type_hints

import numpy as np
from msgspec import Meta

from swarmwire.comms.base.arrays import AnyArray
from swarmwire.comms.base.errors import BadFrame, BadInput
from swarmwire.comms.base.geometry.floor import FloorImage
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.base.sentinels import BROADCAST, NO_ROBOT
from swarmwire.comms.observe.run_views import ObservedRun, ObservedTick
from swarmwire.comms.observe.truth import EventRecord, Static, Truth
from swarmwire.comms.radio.records import PacketCounts, ReceptionRecords
from swarmwire.comms.robot.bodies.body import Body, body_from_mapping
from swarmwire.comms.robot.bodies.drives import BRIGHTEST
from swarmwire.comms.robot.packets import Fate
from swarmwire.comms.robot.tick_io import MAX_STATE, GroupReadings, Readings
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.frames import Frame, checked_array, typed

OBSERVED_VERSION = 1  # version of the frames for observers
_MAY_BE_INFINITE = ".height_m"  # end of the key of an obstacle's height
_RECEPTIONS = tuple(
    field.name for field in fields(ReceptionRecords) if field.name not in ("rssi_dbm", "payload", "payloads")
)
_COUNTS = ("sent", "intended", "in_range")  # rows of the array `tally`; the fates are in `tally/fates`
_Events = list[tuple[int, float, str, bool, str, bool]]  # serial, at_s, do, ended, part, singly
_States: Any = Annotated[tuple[Annotated[str, Meta(max_length=MAX_STATE)], ...], Meta(min_length=1)]


def encode_scene(scene: ObservedRun) -> bytes:
    """Encode a `scene` frame."""
    return frames.encode("scene", -1, {}, {"version": OBSERVED_VERSION, "scene": asdict(scene)})


def decode_scene(frame: Frame) -> ObservedRun:
    """Decode a `scene` frame; BadFrame if it holds no `ObservedRun`, or contradicts itself."""
    check_version(frame, "scene")
    scene: ObservedRun = _build(ObservedRun, frame.values.get("scene"), "scene")
    _check_static(scene.static)
    if scene.selected not in scene.static.robot_names:
        raise BadFrame("malformed", "selected: expected one of the robots")
    return scene


def check_version(frame: Frame, kind: str) -> None:
    """Raise BadFrame unless the frame is of this kind and of version `OBSERVED_VERSION`."""
    version = frame.values.get("version")
    if frame.kind != kind or type(version) is not int or version != OBSERVED_VERSION:
        raise BadFrame("malformed", f"{frame.kind} {version!r}: expected {kind} {OBSERVED_VERSION}")


def _check_static(static: Static) -> None:
    """Raise BadFrame if counts disagree, or a divisor is not above 0."""
    starts = [0, *(group.stop for group in static.groups)]
    image = static.floor.image if static.floor else None
    faults = {
        "seeds: expected an arena": not static.seeds,
        "rate_hz: expected 1 or more": static.rate_hz < 1,
        "arena_size_m: expected more than 0": min(static.arena_size_m) <= 0,
        "obstacles: expected a list per arena": len(static.obstacles) != static.arenas,
        "obstacles: expected equal numbers of movable ones": len(set(map(_movable_count, static.obstacles))) > 1,
        "lights: expected a list per arena": len(static.lights) not in (0, static.arenas),
        "floor.image: expected a grey for each row and column": image is not None and not _is_complete(image),
        "groups: expected each robot in one": [group.start for group in static.groups] != starts[:-1]
        or starts != sorted(set(starts))
        or starts[-1] != static.robots,
        "act_every_ticks: expected 1 or more": any(group.act_every_ticks < 1 for group in static.groups),
    }
    for fault, is_present in faults.items():
        if is_present:
            raise BadFrame("malformed", fault)


def _movable_count(obstacles: tuple[Obstacle, ...]) -> int:
    return sum(obstacle.movable for obstacle in obstacles)


def _is_complete(image: FloorImage) -> bool:
    try:
        return min(image.grey.shape) > 0
    except (ValueError, zlib.error):
        return False


def _build(hint: Any, value: object, key: str) -> Any:
    """Convert `value`, made of maps, lists and plain values, to an instance of the type `hint`."""
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
    needed = {field.name for field in fields(kind) if field.default is MISSING}  # older records lack newer fields
    if type(value) is not dict or not needed <= cast("dict[str, object]", value).keys() <= set(names):
        raise BadFrame("malformed", f"{key}: expected a map of {', '.join(names)}")
    hints, values = get_type_hints(kind), cast("dict[str, object]", value)
    return kind(**{name: _build(hints[name], item, f"{key}.{name}") for name, item in values.items()})


def _body(value: object, key: str) -> Body:
    if type(value) is not dict:
        raise BadFrame("malformed", f"{key}: expected a body")
    try:
        return body_from_mapping(cast("dict[str, Any]", value), where=key)
    except BadInput as error:
        raise BadFrame("malformed", str(error)) from error


def encode_truth(observed: ObservedTick) -> bytes:
    """Encode a `truth` frame."""
    truth = observed.truth
    values: dict[str, Any] = {
        "version": OBSERVED_VERSION,
        "time_ns": truth.time_ns,
        "serial": observed.serial,
        "ticks": observed.ticks,
        "states": truth.states,
        "events": [
            (event.serial, float(event.at_s), event.do, event.ended, event.part, event.singly) for event in truth.events
        ],
    }
    return frames.encode("truth", truth.tick, _arrays(observed), values)


def _arrays(observed: ObservedTick) -> dict[str, AnyArray]:
    """Return the arrays of a tick; an array that `Truth` lacks (None) is left out."""
    truth = observed.truth
    arrays: dict[str, AnyArray] = {
        "alive": truth.alive,
        "pose": truth.pose,
        "velocity": truth.velocity,
        "command": truth.command,
        "state": truth.state,
        "leds": truth.leds,
        "contact_onsets": truth.contact_onsets,
        "values": observed.values,
    }
    for name, group in truth.readings.items():
        arrays[f"readings/{name}/rows"] = group.rows
        for sensor, column in group.fields.items():
            arrays[f"readings/{name}/{sensor}"] = column
    if truth.movable is not None:
        arrays["movable"] = truth.movable.reshape(len(truth.movable), -1)
    if truth.edges is not None:
        arrays["edges"] = truth.edges
    if truth.tally is not None:
        arrays["tally"] = np.array([getattr(truth.tally, name) for name in _COUNTS])
        arrays["tally/fates"] = truth.tally.fates
    if truth.finished is not None:
        arrays["finished"] = np.array([getattr(truth.finished, name) for name in _RECEPTIONS])
        if truth.finished.rssi_dbm is not None:
            arrays["finished/rssi_dbm"] = truth.finished.rssi_dbm
    if truth.events:
        arrays["events"] = np.array([event.changed for event in truth.events])
    return arrays


def decode_truth(frame: Frame, scene: ObservedRun) -> ObservedTick:
    """Decode a `truth` frame of this run; BadFrame if it holds no `ObservedTick`, or contradicts itself."""
    check_version(frame, "truth")
    static = scene.static
    n = static.arenas * static.robots
    states: tuple[str, ...] = typed(_States, frame.values.get("states"), "states")
    state = checked_array(frame, "state", "<i8", (n,))
    _check_range("state", state, len(states))
    leds = checked_array(frame, "leds", "<i8", (n, static.max_leds))
    _check_range("leds", leds, BRIGHTEST + 1)
    truth = Truth(
        tick=_at_least(frame.tick, 0, "tick"),
        time_ns=_at_least(frame.values.get("time_ns"), 0, "time_ns"),
        running=np.ones(static.arenas, np.bool_),  # arenas that have left the world are not published
        alive=checked_array(frame, "alive", "|b1", (n,)),
        pose=checked_array(frame, "pose", "<f8", (n, 3)),
        velocity=checked_array(frame, "velocity", "<f8", (n, 3)),
        command=checked_array(frame, "command", "<f8", (n, 3)),
        state=state,
        states=states,
        leds=leds,
        readings=_readings(frame, static),
        contact_onsets=checked_array(frame, "contact_onsets", "<i8", (static.arenas, 2)),
        edges=_edges(frame, n),
        tally=_counts(frame, static.arenas),
        finished=_receptions(frame, static),
        events=_events(frame, n),
        movable=_movable_poses(frame, static),
    )
    values = checked_array(frame, "values", "<f8", (len(scene.series), static.arenas))
    serial, ticks = _at_least(frame.values.get("serial"), 0, "serial"), _at_least(frame.values.get("ticks"), 1, "ticks")
    return ObservedTick(truth, serial, ticks, values)


def _at_least(value: object, minimum: int, name: str) -> int:
    if type(value) is not int or value < minimum:
        raise BadFrame("malformed", f"{name}: expected a whole number of at least {minimum}")
    return value


def _check_range(name: str, array: AnyArray, end: int, first: int = 0) -> None:
    if ((array < first) | (array >= end)).any():
        raise BadFrame("malformed", f"{name}: expected {first} to {end - 1}")


def _edges(frame: Frame, n: int) -> AnyArray | None:
    if "edges" not in frame.arrays:
        return None
    edges = checked_array(frame, "edges", "<i8", (None, 2))
    _check_range("edges", edges, n)
    return edges


def _movable_poses(frame: Frame, static: Static) -> AnyArray | None:
    if not static.movable:
        return None
    poses = checked_array(frame, "movable", "<f8", (static.arenas, 3 * static.movable))
    return poses.reshape(static.arenas, static.movable, 3)


def _counts(frame: Frame, arenas: int) -> PacketCounts | None:
    if "tally" not in frame.arrays:
        return None
    sent, intended, in_range = checked_array(frame, "tally", "<i8", (len(_COUNTS), arenas))
    return PacketCounts(sent, intended, in_range, checked_array(frame, "tally/fates", "<i8", (arenas, len(Fate))))


def _receptions(frame: Frame, static: Static) -> ReceptionRecords | None:
    if "finished" not in frame.arrays:
        return None
    columns = dict(zip(_RECEPTIONS, checked_array(frame, "finished", "<i8", (len(_RECEPTIONS), None)), strict=True))
    _check_range("finished.arena", columns["arena"], static.arenas)
    _check_range("finished.sender", columns["sender"], static.robots)
    _check_range("finished.receiver", columns["receiver"], static.robots, first=NO_ROBOT)
    _check_range("finished.to", columns["to"], static.robots, first=BROADCAST)
    _check_range("finished.fate", columns["fate"], len(Fate))
    rssi_dbm = None
    if "finished/rssi_dbm" in frame.arrays:
        rssi_dbm = checked_array(frame, "finished/rssi_dbm", "<f8", (len(columns["arena"]),))
    return ReceptionRecords(**columns, rssi_dbm=rssi_dbm)


def _events(frame: Frame, n: int) -> tuple[EventRecord, ...]:
    events = typed(_Events, frame.values.get("events"), "events")
    if not events:
        return ()
    changed = checked_array(frame, "events", "|b1", (len(events), n))
    return tuple(
        EventRecord(serial, at_s, do, ended, row, failing_part, singly)
        for (serial, at_s, do, ended, failing_part, singly), row in zip(events, changed, strict=True)
    )


def _readings(frame: Frame, static: Static) -> Readings:
    """Decode the readings of some robots; groups, rows and lengths are checked, names of sensors are not."""
    groups: dict[str, dict[str, AnyArray]] = {}
    for key in frame.arrays:
        if key.startswith("readings/"):
            _, name, sensor = (*key.split("/", 2), "")[:3]
            groups.setdefault(name, {})[sensor] = frame.arrays[key]
    if not groups.keys() <= {group.name for group in static.groups}:
        raise BadFrame("malformed", "readings: expected groups of this run")
    readings: Readings = {}
    for name, columns in groups.items():
        rows = checked_array(frame, f"readings/{name}/rows", "<i8", (None,))
        _check_range(f"readings/{name}/rows", rows, static.arenas * static.robots)
        del columns["rows"]
        if any(column.dtype != np.float64 or len(column) != len(rows) for column in columns.values()):
            raise BadFrame("malformed", f"readings/{name}: expected a row of numbers for each robot")
        readings[name] = GroupReadings(rows, columns)
    return readings

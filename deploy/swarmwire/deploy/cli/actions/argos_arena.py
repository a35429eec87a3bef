"""The arena of an ARGoS experiment: its obstacles, lights and robots as tables of a scenario.

Positions are moved so that the arena's centre is the origin. A `Draft` collects the tables, and notes what has no
counterpart.
"""

import math
import re
from dataclasses import dataclass, field
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.deploy.cli.actions.argos_controllers import ArgosController
from swarmwire.world.placement.occupancy import obstacle_at
from swarmwire.world.scenario.arena import BoxTable, CylinderTable

BODIES = {  # ARGoS's robot: the body, and how it differs
    "foot-bot": ("footbot", ""),
    "e-puck": ("epuck", ""),
    "kilobot": ("kilobot", ""),
    "pi-puck": ("epuck2", "the e-puck2 is the nearest body"),
    "eye-bot": ("crazyflie", "the crazyflie is the nearest flying body; it keeps its height"),
    "spiri": ("crazyflie", "the crazyflie is the nearest flying body; it keeps its height"),
    "drone": ("crazyflie", "the crazyflie is the nearest flying body; it keeps its height"),
}
OTHER_BODY = "footbot", "the footbot stands for it: write a data sheet"
SHEETS: dict[str, dict[str, Any]] = {"positioning": {}, "compass": {}}  # sensors that any body can have
CIRCLE_DEG = 360.0
WIDE_DEG = 100.0  # standard deviation from which a normal angle is uniform on the circle to within 1 %

Table = dict[str, Any]
Point = tuple[float, float]


@dataclass(frozen=True)
class Positions:
    """Positions of <distribute>: listed points, or a region as a scenario has it."""

    points: tuple[Point, ...] = ()
    region: Table | None = None


@dataclass
class Draft:
    """The scenario that is being written."""

    root: Element
    where: str
    agents_file: str
    centre: Point = (0.0, 0.0)  # of ARGoS's arena
    obstacles: list[Table] = field(default_factory=list[Table])
    lights: list[Table] = field(default_factory=list[Table])
    robots: dict[str, Table] = field(default_factory=dict[str, Table])
    radios: list[Element] = field(default_factory=list[Element])  # an element of each group of robots with a radio
    notes: dict[str, str] = field(default_factory=dict[str, str])  # element: the reason why it is not taken over
    controllers: dict[str, ArgosController] = field(default_factory=dict[str, ArgosController])
    groups: dict[tuple[str, ...], str] = field(default_factory=dict[tuple[str, ...], str])  # robots listed one by one

    def note(self, element: str, reason: str) -> None:
        """Note an element that is not taken over, once."""
        self.notes.setdefault(element, reason)


def _numbers(text: str) -> list[float]:
    return [float(number) for number in text.split(",")]


def point_of(text: str) -> Point:
    """Return x and y of numbers such as "1,2,0"."""
    x, y = _numbers(text)[:2]
    return x, y


def _at(draft: Draft, text: str) -> Point:
    """Return a position in the scenario's frame."""
    x, y = point_of(text)
    return round(x - draft.centre[0], 9), round(y - draft.centre[1], 9)


def title_of(element: Element) -> str:
    """Return an element's name, with its id or label, for a note."""
    label = next((f' {key}="{element.get(key)}"' for key in ("id", "label") if element.get(key)), "")
    return f"<{element.tag}{label}>"


def add_entity(
    draft: Draft, element: Element, positions: Positions, heading_rad: float | None, quantity: int = 1
) -> None:
    """Add an entity, or `quantity` equal ones; without positions it has its own."""
    if element.tag == "distribute":
        _distribute(draft, element)
        return
    body = element if element.tag == "light" else element.find("body")
    if not positions.points and positions.region is None and body is not None:
        positions, heading_rad = Positions((_at(draft, body.attrib["position"]),)), _heading(draft, element, body)
    if element.tag in ("box", "cylinder", "light"):
        is_light = element.tag == "light"
        table = {"intensity": float(element.attrib["intensity"])} if is_light else _obstacle(draft, element)
        if heading_rad is not None and element.tag == "box" and (heading_rad or positions.region):
            table["heading_rad"] = heading_rad
        tables = draft.lights if is_light else draft.obstacles
        tables += [table | {"at": list(point)} for point in positions.points]
        if positions.region is not None:
            tables.append(table | {"count": quantity, "place": "random", "within": positions.region})
    elif element.find("controller") is not None:
        add_robots(draft, element, quantity, positions, heading_rad)
    else:
        draft.note(title_of(element), "no entity of this kind")


def _heading(draft: Draft, element: Element, body: Element) -> float:
    """Return the heading of <body>, whose orientation is the rotation about z, y and x in degrees."""
    z, *others = _numbers(body.get("orientation", "0,0,0"))
    if any(others):
        draft.note(f"orientation of {title_of(element)}", "only the rotation about z")
    return round(math.radians(math.remainder(z, CIRCLE_DEG)), 9)


def _obstacle(draft: Draft, element: Element) -> Table:
    if element.tag == "box":
        *size_m, height_m = _numbers(element.attrib["size"])
        table: Table = {"shape": "box", "size_m": size_m, "height_m": height_m}
    else:
        radius_m, height_m = float(element.attrib["radius"]), float(element.attrib["height"])
        table = {"shape": "cylinder", "radius_m": radius_m, "height_m": height_m}
    if element.get("movable") == "true":
        table |= {"movable": True, "mass_kg": float(element.attrib["mass"])}
    if element.find("leds") is not None:
        draft.note(f"<leds> of {title_of(element)}", "obstacles have no LEDs; [arena] lights shine")
    return table


def _distribute(draft: Draft, element: Element) -> None:
    position, orientation, entity = (element.find(name) for name in ("position", "orientation", "entity"))
    if position is None or orientation is None or entity is None or not len(entity):
        raise BadInput(draft.where, "arena.distribute", "expected <position>, <orientation> and <entity> with a robot")
    quantity = int(entity.attrib["quantity"])
    positions = _positions(draft, position, entity[0], quantity)
    add_entity(draft, entity[0], positions, _spread_heading(draft, orientation, entity[0]), quantity)


def _positions(draft: Draft, position: Element, entity: Element, quantity: int) -> Positions:
    method = position.attrib["method"]
    if method == "constant":
        return Positions((_at(draft, position.attrib["values"]),) * quantity)
    if method == "grid":  # GridGenerator in ARGoS's space.cpp: from the greatest x and y downwards, x first
        (x, y), (dx, dy) = _at(draft, position.attrib["center"]), point_of(position.attrib["distances"])
        columns, rows = (int(number) for number in point_of(position.attrib["layout"]))
        cells = ((i % columns, i // columns % rows) for i in range(quantity))
        points = ((x + dx * (0.5 * (columns - 1) - i), y + dy * (0.5 * (rows - 1) - j)) for i, j in cells)
        return Positions(tuple((round(px, 9), round(py, 9)) for px, py in points))
    if method == "gaussian":
        (x, y), deviation = _at(draft, position.attrib["mean"]), point_of(position.attrib["std_dev"])
        half_m = tuple(math.sqrt(3.0) * side for side in deviation)
        draft.note(f"gaussian position of {title_of(entity)}", "uniform in the rectangle with the same deviations")
        low, high = (x - half_m[0], y - half_m[1]), (x + half_m[0], y + half_m[1])
    elif method == "uniform":
        low, high = _at(draft, position.attrib["min"]), _at(draft, position.attrib["max"])
    else:
        raise BadInput(draft.where, "arena.distribute.position.method", f"expected one of ARGoS's, got {method!r}")
    size_m = [round(max(high[i] - low[i], 1e-3), 9) for i in (0, 1)]  # a line is a rectangle 1 mm wide
    return Positions(
        region={"how": "box", "size_m": size_m, "at": [round(0.5 * (low[i] + high[i]), 9) for i in (0, 1)]}
    )


def _spread_heading(draft: Draft, orientation: Element, entity: Element) -> float | None:
    """Return the heading of all; None: random on the full circle."""
    method, title = orientation.attrib["method"], f"orientation of {title_of(entity)}"
    if method == "constant":
        return _heading(draft, entity, Element("body", orientation=orientation.attrib["values"]))
    if method == "uniform":
        low, high = _numbers(orientation.attrib["min"])[0], _numbers(orientation.attrib["max"])[0]
        if high > low:
            if high - low < CIRCLE_DEG:
                draft.note(title, "random on the full circle")
            return None
        return math.radians(math.remainder(low, CIRCLE_DEG))
    deviation = _numbers(orientation.attrib["std_dev"])[0]
    if deviation >= WIDE_DEG:
        return None
    if deviation:
        draft.note(title, "its mean, for all")
    return math.radians(math.remainder(_numbers(orientation.attrib["mean"])[0], CIRCLE_DEG))


def add_robots(draft: Draft, element: Element, count: int, positions: Positions, heading_rad: float | None) -> None:
    """Add robots: a group, or if they are listed one by one, those of an earlier group of the same kind."""
    config = element.find("controller")
    identity = config.get("config", "") if config is not None else ""
    if config is not None and identity not in draft.controllers:
        raise BadInput(draft.where, f"arena.{element.tag}.controller", f"expected a controller, got {identity!r}")
    if positions.points and heading_rad is None:
        draft.note(f"orientation of {title_of(element)}", "0 for all: robots at listed points have listed headings")
    poses = [[x, y, heading_rad or 0.0] for x, y in positions.points]
    key = (element.tag, identity, *sorted(f"{name}={value}" for name, value in element.items() if name != "id"))
    if poses and key in draft.groups:
        group = draft.robots[draft.groups[key]]
        group["count"] += count
        group["place"]["poses"] += poses
        return
    stem = re.sub(r"\W", "_", element.get("id", element.tag)).rstrip("_0123456789")
    name = unique = stem if re.match(r"[A-Za-z]", stem) else "robots"
    while unique in draft.robots:
        unique = f"{name}_{sum(other.startswith(name) for other in draft.robots) + 1}"
    region = positions.region or {"how": "arena"}
    heading = {} if heading_rad is None else {"heading_rad": heading_rad}
    placement = {"how": "poses", "poses": poses} if poses else region | heading
    draft.robots[unique] = _group(draft, element, draft.controllers.get(identity)) | {
        "count": count,
        "place": placement,
    }
    if poses:
        draft.groups[key] = unique


def _group(draft: Draft, element: Element, controller: ArgosController | None) -> Table:
    body, reason = BODIES.get(element.tag, OTHER_BODY)
    if reason:
        draft.note(f"<{element.tag}>", reason)
    sensors: dict[str, Table] = {}
    present = load_body(body).sensors
    if controller is None:
        return {"body": body, "agent": "swarmwire.agent.behaviours:RandomWalk"}
    for need in [need for need in controller.needs if not need.startswith("radio.") and need not in present]:
        if need in SHEETS:
            sensors[need] = SHEETS[need]
        else:
            draft.note(f"<{controller.needs.pop(need)}>", f"the body {body} has no {need}")
    sensors |= {name: {"noise": noise} for name, noise in controller.noise.items() if name in present}
    for attribute in sorted(element.attrib.keys() - {"id", "rab_range", "rab_data_size"}):
        if attribute == "omnidirectional_camera_aperture" and "camera" in present:
            sensors["camera"] = {"aperture_deg": float(element.attrib[attribute])}
        else:
            draft.note(f"{attribute} of {title_of(element)}", "no key of the body")
    for child in element:
        if child.tag not in ("body", "controller"):
            draft.note(f"<{child.tag}> of {title_of(element)}", "no key of the body; see its data sheet")
    if controller.has_radio:
        draft.radios.append(element)
    table: Table = {"body": body, "agent": f"{draft.agents_file}:{controller.class_name}"}
    table |= {"params": controller.params} if controller.params else {}
    return table | ({"body_overrides": {"sensors": sensors}} if sensors else {})


def _extents(draft: Draft) -> list[tuple[FloatArray, FloatArray]]:
    """Return the least and greatest x, y of each obstacle at a fixed position."""
    extents: list[tuple[FloatArray, FloatArray]] = []
    for obstacle in (obstacle for obstacle in draft.obstacles if "at" in obstacle):
        table = (BoxTable if obstacle["shape"] == "box" else CylinderTable).model_validate(obstacle)
        x_m, y_m = obstacle["at"]
        extents.append(obstacle_at(table, x_m, y_m, obstacle.get("heading_rad", 0.0)).extent_m)
    return extents


def size_around(draft: Draft, size_m: Point) -> Point:
    """Return the size of the arena, larger than ARGoS's if an obstacle at a fixed position reaches beyond it."""
    ends_m = np.array([np.abs(end) for extents in _extents(draft) for end in extents]).reshape(-1, 2)
    width_m, height_m = (round(float(side), 6) for side in np.maximum(size_m, 2.0 * ends_m.max(axis=0, initial=0.0)))
    if (width_m, height_m) != size_m:
        reason = f"{width_m:g} x {height_m:g} m, so that all obstacles lie within it"
        draft.note(f'size="{size_m[0]:g},{size_m[1]:g}" of <arena>', reason)
    return width_m, height_m


def clear_light(draft: Draft, table: Table) -> Table:
    """Return a light, moved towards the arena's centre until it is in no obstacle: lights have no height."""
    if "at" not in table:
        return table
    x, y = table["at"]
    extents = _extents(draft)
    at_m: FloatArray = np.array(table["at"])
    share = 1.0  # of the distance from the centre
    while share > 0.0 and any(np.all(low <= at_m) and np.all(at_m <= high) for low, high in extents):
        share -= 0.01
        at_m = share * np.array(table["at"])
    if share < 1.0:
        draft.note(f"position of <light> at ({x:g}, {y:g})", "moved out of an obstacle: lights have no height")
    return table | {"at": [round(float(end), 6) for end in at_m]}

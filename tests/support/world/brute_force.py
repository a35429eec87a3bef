"""Expected readings of sensors by brute force: slow, plain, and independent of the kernels.

Everything is an upright prism: a disc or a convex polygon between two heights. On a torus it has nine copies.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import atan2, cos, exp, inf, pi, remainder, sin, sqrt, tau

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.geometry.ground import ground_of
from swarmwire.comms.base.geometry.obstacles import obstacle_arrays
from swarmwire.comms.base.geometry.shapes import Boundary, Obstacle
from swarmwire.comms.observe.truth import Group, Light
from swarmwire.comms.robot.bodies.body import Body, load_body
from swarmwire.world.sensors.sensor import Scene, led_positions_m

Point = tuple[float, float]
EPUCK, FOOTBOT = load_body("epuck"), load_body("footbot")
DRONE = replace(EPUCK, name="drone", radius_m=0.05, altitude_m=0.1, height_m=0.05)


@dataclass(frozen=True)
class Prism:
    x: float
    y: float
    radius: float  # 0 for polygons
    corners: tuple[Point, ...]  # empty for discs
    bottom: float
    top: float

    def moved(self, dx: float, dy: float) -> "Prism":
        corners = tuple((x + dx, y + dy) for x, y in self.corners)
        return replace(self, x=self.x + dx, y=self.y + dy, corners=corners)

    def stretch(self, x: float, y: float, dx: float, dy: float) -> tuple[float, float] | None:
        """First and last t at which the line x + t dx, y + t dy is inside, or None."""
        if not self.corners:
            t = ((self.x - x) * dx + (self.y - y) * dy) / (dx * dx + dy * dy)
            off2 = (x + t * dx - self.x) ** 2 + (y + t * dy - self.y) ** 2
            if off2 >= self.radius**2:
                return None
            half = sqrt((self.radius**2 - off2) / (dx * dx + dy * dy))
            return t - half, t + half
        crossings = list[float]()
        for (ax, ay), (bx, by) in zip(self.corners, (*self.corners[1:], self.corners[0]), strict=True):
            ex, ey = bx - ax, by - ay
            parallel = dx * ey - dy * ex
            if parallel != 0.0:
                along = ((ax - x) * dy - (ay - y) * dx) / parallel
                if 0.0 <= along <= 1.0:
                    crossings.append(((ax - x) * ey - (ay - y) * ex) / parallel)
        return (min(crossings), max(crossings)) if crossings else None

    def distance(self, x: float, y: float, angle: float) -> float:
        """Distance along a ray; 0 from inside, inf if it misses."""
        inside = self.stretch(x, y, cos(angle), sin(angle))
        return max(inside[0], 0.0) if inside and inside[1] >= 0.0 else inf


@dataclass(frozen=True)
class Sample:
    scene: Scene
    groups: tuple[Group, ...]
    obstacles: tuple[tuple[Obstacle, ...], ...]

    def rows(self) -> Iterator[tuple[int, Group, int]]:
        """Arena, group and robot of each row."""
        for arena in range(len(self.obstacles)):
            for group in self.groups:
                for robot in range(group.start, group.stop):
                    yield arena, group, robot

    def robots(self, arena: int, but: int, living: tuple[bool, ...] = (True, False)) -> list[Prism]:
        scene, prisms = self.scene, list[Prism]()
        for j in range(len(scene.radius_m)):
            if j != but and bool(scene.alive[arena, j]) in living:
                x, y = scene.state[arena, j, :2].tolist()
                heights = float(scene.bottom_m[j]), float(scene.top_m[j])
                prisms += self.copies(Prism(x, y, float(scene.radius_m[j]), (), *heights))
        return prisms

    def fixed(self, arena: int) -> list[Prism]:
        prisms = list[Prism]()
        for o in self.obstacles[arena]:
            corners = () if o.shape == "cylinder" else tuple((x, y) for x, y in o.corners_m.tolist())
            prisms += self.copies(Prism(o.x_m, o.y_m, o.radius_m, corners, 0.0, o.height_m))
        return prisms

    def at_height_of(self, prisms: list[Prism], robot: int) -> list[Prism]:
        """The prisms that share a height with a robot."""
        bottom, top = self.scene.bottom_m[robot], self.scene.top_m[robot]
        return [prism for prism in prisms if prism.bottom < top and prism.top > bottom]

    def copies(self, prism: Prism) -> list[Prism]:
        width, height = self.scene.size_m
        shifts = (-1, 0, 1) if self.scene.boundary == "torus" else (0,)
        return [prism.moved(i * width, j * height) for i in shifts for j in shifts]

    def wall(self, x: float, y: float, angle: float) -> float:
        """Distance along a ray to the walls around the arena, inf without."""
        if self.scene.boundary != "walls":
            return inf
        width, height = self.scene.size_m
        corners = (
            (-width / 2, -height / 2),
            (width / 2, -height / 2),
            (width / 2, height / 2),
            (-width / 2, height / 2),
        )
        inside = Prism(0.0, 0.0, 0.0, corners, 0.0, inf).stretch(x, y, cos(angle), sin(angle))
        return max(inside[1], 0.0) if inside else 0.0


def sample(seed: int, boundary: Boundary, each: int = 12) -> Sample:
    """Two crowded arenas of 3 x 2.4 m: robots on the floor, taller and flying robots, and obstacles of all kinds."""
    random, size_m = np.random.default_rng(seed), (3.0, 2.4)
    groups = tuple(Group(b.name, b, k * each, (k + 1) * each) for k, b in enumerate((EPUCK, FOOTBOT, DRONE)))
    bodies: list[Body] = [group.body for group in groups for _ in range(each)]
    state = np.zeros((2, 3 * each, 6))
    state[:, :, :3] = random.uniform(-1, 1, (2, 3 * each, 3)) * [1.5, 1.2, 10.0]
    obstacles = tuple(tuple(obstacle(random, size_m) for _ in range(8)) for _ in range(2))
    bottom_m = np.array([body.altitude_m for body in bodies])
    most = max(body.led_count for body in bodies)
    leds = random.integers(1, 0xFFFFFF, (2, 3 * each, most)) * random.integers(0, 2, (2, 3 * each, most))
    for i, body in enumerate(bodies):
        leds[:, i, body.led_count :] = 0
    lit = tuple(tuple(Light(*random.uniform(-1.2, 1.2, 2).tolist(), 0.5) for _ in range(2)) for _ in range(2))
    scene = Scene(
        keys=np.array([7, 8], np.uint64),
        size_m=size_m,
        boundary=boundary,
        obstacles=obstacle_arrays(obstacles),
        lights=lit,
        ground=ground_of(None, size_m, boundary),
        tick_s=0.1,
        radius_m=np.array([body.radius_m for body in bodies]),
        bottom_m=bottom_m,
        top_m=bottom_m + [body.height_m for body in bodies],
        state=state,
        travel_m=np.zeros((2, 3 * each, 2)),
        touched=np.zeros((2, 3 * each)),
        target=np.zeros((2, 3 * each, 3)),
        alive=random.random((2, 3 * each)) < 0.8,
        running=np.ones(2, np.bool_),
        charge=np.ones((2, 3 * each)),
        leds=leds,
        led_positions_m=led_positions_m(groups, most),
    )
    return Sample(scene, groups, obstacles)


def obstacle(random: np.random.Generator, size_m: tuple[float, float]) -> Obstacle:
    """A cylinder, box or polygon anywhere, often lower than some robots."""
    x, y = (random.uniform(-0.5, 0.5, 2) * size_m).tolist()
    heading, height = float(random.uniform(-pi, pi)), float(random.choice([0.04, 0.12, 0.2, inf]))
    kind = int(random.integers(3))
    if kind == 0:
        return Obstacle("cylinder", x, y, radius_m=float(random.uniform(0.02, 0.2)), height_m=height)
    if kind == 1:
        box = random.uniform(0.02, 0.6, 2).tolist()
        return Obstacle("box", x, y, heading, size_m=(box[0], box[1]), height_m=height)
    turn = np.sort(random.uniform(0.0, tau, 5)) + np.arange(5) * 1e-3
    points = tuple((0.2 * cos(a), 0.2 * sin(a)) for a in turn)
    return Obstacle("polygon", x, y, heading, points_m=points, height_m=height)


def rim_rays(crowd: Sample, active: bool, angle_rad: FloatArray, range_m: float) -> FloatArray:
    """The distance along each ray from the rim of each row, (rows, rays); passive rays see robots alive alone."""
    distance_m = np.full((len(list(crowd.rows())), len(angle_rad)), inf)
    for row, (arena, _, robot) in enumerate(crowd.rows()):
        x, y, heading = crowd.scene.state[arena, robot, :3].tolist()
        rim, dead = float(crowd.scene.radius_m[robot]), crowd.robots(arena, robot, (False,))
        robots, fixed = (
            crowd.at_height_of(crowd.robots(arena, robot, (True,)), robot),
            crowd.at_height_of(crowd.fixed(arena) + dead, robot),
        )
        for ray, angle in enumerate(heading + angle_rad):
            px, py = x + rim * cos(angle), y + rim * sin(angle)
            solid = min([t.distance(px, py, angle) for t in fixed] + [crowd.wall(px, py, angle)])
            near = min((t.distance(px, py, angle) for t in robots), default=inf)
            if active:
                near = min(near, solid)
            distance_m[row, ray] = near if near <= min(range_m, solid) else inf
    return distance_m


def scan_distances(crowd: Sample, angle_rad: FloatArray, range_m: float, at_m: float) -> FloatArray:
    """The distance along each ray of a laser scanner of each row, (rows, rays)."""
    distance_m = np.full((len(list(crowd.rows())), len(angle_rad)), inf)
    for row, (arena, _, robot) in enumerate(crowd.rows()):
        x, y, heading = crowd.scene.state[arena, robot, :3].tolist()
        x, y = x + at_m * cos(heading), y + at_m * sin(heading)
        prisms = crowd.at_height_of(crowd.fixed(arena) + crowd.robots(arena, robot), robot)
        for ray, angle in enumerate(heading + angle_rad):
            near = min([t.distance(x, y, angle) for t in prisms] + [crowd.wall(x, y, angle)])
            distance_m[row, ray] = near if near <= range_m else inf
    return distance_m


def light_values(crowd: Sample, angle_rad: FloatArray) -> FloatArray:
    """Values of the photocells of each row, (rows, cells)."""
    values = np.zeros((len(list(crowd.rows())), len(angle_rad)))
    for row, (arena, _, robot) in enumerate(crowd.rows()):
        x, y, heading = crowd.scene.state[arena, robot, :3].tolist()
        for light in crowd.scene.lights[arena]:
            dx, dy = _shortest(crowd, light.x_m - x, light.y_m - y)
            d = sqrt(dx * dx + dy * dy)
            between = crowd.at_height_of(crowd.robots(arena, robot) + crowd.fixed(arena), robot)
            if d > 2.5 * light.intensity_m or any(t.distance(x, y, atan2(dy, dx)) <= d for t in between):
                continue
            for cell, angle in enumerate(angle_rad):
                off = abs(remainder(atan2(dy, dx) - heading - angle, tau))
                values[row, cell] += exp(-2 * d / light.intensity_m) * max(1 - 2 * off / pi, 0.0)
    return values


def blobs(crowd: Sample, arena: int, robot: int, reach_m: float, height_m: float) -> list[tuple[float, float, int]]:
    """Distance, bearing and colour of each LED that a camera sees, the nearest first."""
    scene, visible = crowd.scene, list[tuple[float, float, int]]()
    x, y, heading = scene.state[arena, robot, :3].tolist()
    eye = float(scene.bottom_m[robot]) + height_m
    bodies = crowd.robots(arena, robot) + crowd.fixed(arena)
    for other in (j for j in range(len(scene.radius_m)) if j != robot):
        ox, oy, turn = scene.state[arena, other, :3].tolist()
        dx, dy = _shortest(crowd, ox - x, oy - y)
        for (ahead, left, up), rgb in zip(
            scene.led_positions_m[other].tolist(), scene.leds[arena, other].tolist(), strict=True
        ):
            lx, ly = dx + ahead * cos(turn) - left * sin(turn), dy + ahead * sin(turn) + left * cos(turn)
            z = float(scene.bottom_m[other]) + up
            d = sqrt(lx * lx + ly * ly)
            if rgb and d <= reach_m and z < eye and not any(_hides(t, (x, y, eye), (lx, ly, z - eye)) for t in bodies):
                visible.append((d, remainder(atan2(ly, lx) - heading, tau), rgb))
    return sorted(visible)


def _hides(prism: Prism, eye: tuple[float, float, float], to: tuple[float, float, float]) -> bool:
    """Return True if the line `to` from an eye crosses a prism before its end, which may lie on the surface."""
    inside = prism.stretch(eye[0], eye[1], to[0], to[1])
    if inside is None:
        return False
    first, last = max(inside[0], 0.0), min(inside[1], 1.0 - 1e-6)
    heights = eye[2] + first * to[2], eye[2] + last * to[2]
    return first < last and min(heights) < prism.top and max(heights) > prism.bottom


def _shortest(crowd: Sample, dx: float, dy: float) -> Point:
    if crowd.scene.boundary != "torus":
        return dx, dy
    width, height = crowd.scene.size_m
    return remainder(dx, width), remainder(dy, height)

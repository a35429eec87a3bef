"""Draws docs/routing.svg: radio graph and routes of the example mesh, before and after the death of a robot.

It runs the example: so it needs babeld and iproute2, and the rights for network interfaces.
"""

import json
import re
import subprocess
import sys
from math import hypot
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Event

from docs.pictures.svg import FAINT, INK, page, text
from swarmwire.world.interfaces.entering import INTERFACES
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.scenario.tables import AtPoses
from swarmwire.world.scenario_file import load_scenario

DOCS = Path(__file__).parents[1]
MESH = DOCS.parent / "examples" / "interfaces" / "mesh.toml"
DESTINATION, DEAD = 9, 4
SCALE, LEFT, TOP, PANEL = 34.0, 200.0, 110.0, 350.0  # pixels a metre; of the first panel's origin; from panel to panel
MIDDLE, HEIGHT = -0.8, 200.0  # of the robots along x, in m; of the figure, in pixels
RADIUS = 12.0
LIVE_FILL, DEAD_FILL, END_FILL = "#bfdbfe", "#e2e8f0", "#fde68a"
POLL_S, CONVERGED_S = 0.5, 10.0
Routes = dict[int, int]  # by robot: the next one on the way to the destination


def draw(to: Path = DOCS / "routing.svg") -> None:
    """Write the figure."""
    scenario = load_scenario(MESH, [])
    before, after = _routes(len(scenario.robot_names()))
    edges = _edges(scenario)
    points = [(LEFT + SCALE * x, TOP - SCALE * y) for x, y in _positions(scenario)]
    shapes = [
        *_panel(0, "radio graph: within 2 m", points, edges, {}, None),
        *_panel(1, f"babeld's routes to {DESTINATION}", points, edges, before, None),
        *_panel(2, f"after the death of {DEAD}", points, edges, after, DEAD),
    ]
    title = f"Ten robots: their radio graph, and the routes to robot {DESTINATION} before and after robot {DEAD} died"
    to.write_text(page(title, 3 * PANEL, HEIGHT, shapes), encoding="utf-8")


def _positions(scenario: Scenario) -> list[tuple[float, float]]:
    positions = scenario.robots["mesh"].place
    assert isinstance(positions, AtPoses)
    return [(x, y) for x, y, _ in positions.poses]


def _edges(scenario: Scenario) -> list[tuple[int, int]]:
    assert scenario.radio is not None
    assert scenario.radio.range_m is not None
    at, reach_m = _positions(scenario), scenario.radio.range_m
    pairs = [(a, b) for b in range(len(at)) for a in range(b)]
    return [(a, b) for a, b in pairs if hypot(at[a][0] - at[b][0], at[a][1] - at[b][1]) <= reach_m]


def _routes(robots: int) -> tuple[Routes, Routes]:
    """The routes once babeld has converged, and once more after a robot has died."""
    with TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        swarmwire = [sys.executable, "-m", "swarmwire.deploy"]
        run = subprocess.Popen([*swarmwire, "run", str(MESH), "--realtime", "1", "--quiet", "--no-rrd", "--out", out])
        try:
            while not (out / INTERFACES).exists():
                Event().wait(POLL_S)
            before = _converged(out, set(range(robots)))
            subprocess.run([*swarmwire, "ctl", "--run", out, "kill", f"mesh-{DEAD}"], check=True)
            after = _converged(out, set(range(robots)) - {DEAD})
        finally:
            run.terminate()
            run.wait()
    return before, after


def _converged(out: Path, robots: set[int]) -> Routes:
    """The routes of these robots, once they have not changed for some time and none leads to a dead robot."""
    routes, unchanged_s = Routes(), 0.0
    while unchanged_s < CONVERGED_S or routes.keys() != robots - {DESTINATION} or not set(routes.values()) <= robots:
        Event().wait(POLL_S)
        now = {robot: hop for robot in robots - {DESTINATION} if (hop := _next(out, robot)) is not None}
        unchanged_s = unchanged_s + POLL_S if now == routes else 0.0
        routes = now
    return routes


def _next(out: Path, robot: int) -> int | None:
    addresses = {
        name: robot["ipv4"].partition("/")[0] for name, robot in json.loads((out / INTERFACES).read_text()).items()
    }
    to = addresses[f"mesh-{DESTINATION}"]
    command = [sys.executable, "-m", "swarmwire.deploy", "exec", str(out), f"mesh-{robot}", "--"]
    printed = subprocess.run([*command, "ip", "route", "show", to], capture_output=True, text=True, check=False).stdout
    via = re.search(r"via ([\d.]+)", printed)
    names = {address: name for name, address in addresses.items()}
    return int(names[via[1]].removeprefix("mesh-")) if via else None


def _panel(
    number: int,
    title: str,
    points: list[tuple[float, float]],
    edges: list[tuple[int, int]],
    routes: Routes,
    dead: int | None,
) -> list[str]:
    at = [(x + number * PANEL, y) for x, y in points]
    shapes = [text(LEFT + SCALE * MIDDLE + number * PANEL, 24.0, title, 14, anchor="middle", bold=True)]
    shapes += [
        f'<path d="M{at[a][0]:g} {at[a][1]:g} L{at[b][0]:g} {at[b][1]:g}" stroke="{FAINT}" fill="none"/>'
        for a, b in edges
        if dead not in (a, b)
    ]
    shapes += [_hop(*at[robot], *at[hop]) for robot, hop in sorted(routes.items())]
    for robot, (x, y) in enumerate(at):
        fill = DEAD_FILL if robot == dead else END_FILL if routes and robot == DESTINATION else LIVE_FILL
        shapes.append(f'<circle cx="{x:g}" cy="{y:g}" r="{RADIUS:g}" fill="{fill}" stroke="{FAINT}"/>')
        shapes.append(text(x, y + 4.0, "×" if robot == dead else str(robot), 12, anchor="middle"))
    return shapes


def _hop(x: float, y: float, to_x: float, to_y: float) -> str:
    """An arrow that ends at the circle of the next robot."""
    share = 1.0 - (RADIUS + 1.0) / hypot(to_x - x, to_y - y)
    way = f"M{x:g} {y:g} L{x + share * (to_x - x):.1f} {y + share * (to_y - y):.1f}"
    return f'<path d="{way}" stroke="{INK}" stroke-width="2" fill="none" marker-end="url(#tip)"/>'


if __name__ == "__main__":
    draw()

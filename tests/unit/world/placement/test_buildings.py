"""Buildings of GeoJSON and SDF files as obstacles."""

import json
from math import cos, pi, radians, sin, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.world.placement import maps
from swarmwire.world.placement.buildings import read_buildings
from swarmwire.world.scenario_file import load_scenario
from tests.support.refusals import refused_input
from tests.unit.world.placement.test_layout import world_of

# An L with a tower of two storeys beside it, a courtyard of 2 m x 2 m in a block of 6 m x 6 m, and a park.
L_SHAPE = [[-8, -6], [-2, -6], [-2, -4], [-6, -4], [-6, 0], [-8, 0], [-8, -6]]
BLOCK, COURT = [[1, 1], [7, 1], [7, 7], [1, 7], [1, 1]], [[3, 3], [3, 5], [5, 5], [5, 3], [3, 3]]
SDF = """<?xml version="1.0"?>
<sdf version="1.9"><world name="w">
  <include><uri>model://sun</uri></include>
  <model name="ground"><static>true</static><link name="l"><collision name="c"><geometry><plane/></geometry></collision>
  </link></model>
  <model name="robot"><link name="l"/></model>
  <model name="yard"><static>1</static><pose>1 2 0 0 0 1.5707963267948966</pose>
    <link name="wall"><pose>2 0 0.5 0 0 0</pose>
      <collision name="c"><pose>0 1 0 0 0 0.2</pose><geometry><box><size>3 0.2 1</size></box></geometry></collision>
      <collision name="roof"><pose>0 0 4 0 0 0</pose><geometry><box><size>3 3 0.1</size></box></geometry></collision>
      <collision name="ramp"><pose>0 0 0 0 0.3 0</pose><geometry><box><size>1 1 1</size></box></geometry></collision>
      <collision name="bush"><geometry><mesh><uri>bush.dae</uri></mesh></geometry></collision>
    </link>
    <model name="post"><pose degrees="true">-1 0 0 0 0 90</pose>
      <link name="l"><collision name="c"><pose>0.5 0 0.75 0 0 0</pose>
        <geometry><cylinder><radius>0.25</radius><length>1.5</length></cylinder></geometry></collision></link>
    </model>
  </model>
</world></sdf>
"""


def feature(*rings: Any, **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "properties": properties, "geometry": {"type": "Polygon", "coordinates": rings}}


def saved(folder: Path, *features: Any, name: str = "town.geojson") -> Path:
    path = folder / name
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return path


def town(folder: Path) -> Path:
    park = feature([[-1, -1], [0, -1], [0, 0], [-1, -1]], leisure="park")
    tree = {"type": "Feature", "properties": None, "geometry": {"type": "Point", "coordinates": [0, 0]}}
    tower = feature([[3, -6], [5, -6], [5, -4], [3, -4], [3, -6]], building="yes", **{"building:levels": "2"})
    high = feature(BLOCK, COURT, building="yes", height="9.5 m")
    return saved(folder, feature(L_SHAPE, building="house"), tower, high, park, tree)


def covering(obstacles: tuple[Obstacle, ...], x_m: float, y_m: float) -> list[Obstacle]:
    """The convex obstacles that a point lies within."""
    inside: list[Obstacle] = []
    for obstacle in obstacles:
        away = np.roll(obstacle.corners_m, -1, axis=0) - obstacle.corners_m
        to_point = np.array([x_m, y_m]) - obstacle.corners_m
        if (away[:, 0] * to_point[:, 1] - away[:, 1] * to_point[:, 0] > 0.0).all():
            inside.append(obstacle)
    return inside


def area_m2(obstacle: Obstacle) -> float:
    x, y = obstacle.corners_m.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def test_geojson_buildings_cover_their_footprints_exactly(tmp_path):
    town(tmp_path)
    world = world_of(tmp_path, {"buildings": {"file": "town.geojson", "height_m": 4.0}})
    assert world.static.arena_size_m == (16.0, 14.0)  # 8 m and 7 m from the origin to the farthest corners
    obstacles = world.static.obstacles[0]
    for x in np.arange(-7.9, 8.0, 0.83).tolist():
        for y in np.arange(-6.9, 7.0, 0.71).tolist():
            in_l = -8 < x < -2 and -6 < y < 0 and (x < -6 or y < -4)
            in_block = 1 < x < 7 and 1 < y < 7 and not (3 < x < 5 and 3 < y < 5)
            in_tower = 3 < x < 5 and -6 < y < -4
            expected = [4.0] * in_l + [9.5] * in_block + [6.0] * in_tower
            assert [obstacle.height_m for obstacle in covering(obstacles, x, y)] == expected, (x, y)
    assert sum(map(area_m2, obstacles)) == pytest.approx(12 + 8 + 32 + 4)
    assert len(obstacles) == 2 + 4 + 1  # the fewest for an L, and for a ring with these corners
    assert len(maps.layout_hints(load_scenario(tmp_path / "maze.toml").arena, str(tmp_path / "maze.toml"))) == 1


@settings(max_examples=15, deadline=None)
@given(st.lists(st.tuples(st.floats(0.3, 5.0), st.floats(0.1, 1.0)), min_size=3, max_size=9))
def test_geojson_parts_are_convex_and_have_the_area_of_a_star(tmp_path_factory, rays):
    turns = np.cumsum([turn for _, turn in rays])
    angles = 2.0 * pi * turns / turns[-1]
    assume(np.diff([*angles, angles[0] + 2.0 * pi]).max() < 0.95 * pi)
    corners = [[radius * cos(angle), radius * sin(angle)] for (radius, _), angle in zip(rays, angles, strict=True)]
    path = saved(tmp_path_factory.mktemp("star"), feature([*corners, corners[0]]))
    obstacles = read_buildings(path, None, None, ("f", "k")).obstacles
    x, y = np.array(corners).T
    area = 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
    assert sum(map(area_m2, obstacles)) == pytest.approx(area, abs=1e-4)
    assert len(obstacles) <= len(corners) - 2
    for obstacle in obstacles:
        sides = np.roll(obstacle.corners_m, -1, axis=0) - obstacle.corners_m
        after = np.roll(sides, -1, axis=0)
        assert (sides[:, 0] * after[:, 1] - sides[:, 1] * after[:, 0] > -1e-9).all()


def test_geojson_degrees_are_metres_from_the_origin(tmp_path):
    """Metres per degree by the radii of curvature of WGS 84, which hold to 1 mm over these 200 m."""
    latitude, longitude, e2 = 48.137, 11.575, 0.00669437999014
    w2 = 1.0 - e2 * sin(radians(latitude)) ** 2
    north_m, east_m = 6378137.0 * (1.0 - e2) / w2**1.5, 6378137.0 * cos(radians(latitude)) / sqrt(w2)
    ring = [[longitude + i * 1e-3, latitude + j * 1e-3] for i, j in ((0, 0), (2, 0), (2, 1), (0, 1), (0, 0))]
    obstacle = read_buildings(saved(tmp_path, feature(ring)), (latitude, longitude), None, ("f", "k")).obstacles[0]
    width_m, length_m = radians(2e-3) * east_m, radians(1e-3) * north_m
    assert obstacle.corners_m.min(axis=0) == pytest.approx([0.0, 0.0], abs=2e-3)
    assert obstacle.corners_m.max(axis=0) == pytest.approx([width_m, length_m], abs=2e-3)
    assert obstacle.height_m == np.inf


def test_sdf_boxes_and_cylinders_of_static_models_stand_at_their_composed_poses(tmp_path):
    """By hand: the model is turned by a quarter, so its x is the world's y, and its y the world's -x."""
    (tmp_path / "town.sdf").write_text(SDF)
    world = world_of(tmp_path, {"size_m": [12.0, 12.0], "buildings": {"file": "town.sdf"}})
    box, post = world.static.obstacles[0]
    assert (box.shape, box.size_m, box.height_m) == ("box", (3.0, 0.2), pytest.approx(1.0))
    assert (box.x_m, box.y_m, box.heading_rad) == pytest.approx((1.0 - 1.0, 2.0 + 2.0, pi / 2 + 0.2))
    assert (post.shape, post.radius_m, post.height_m) == ("cylinder", 0.25, pytest.approx(1.5))
    assert (post.x_m, post.y_m) == pytest.approx((1.0 - 0.5, 2.0 - 1.0))
    left_out = read_buildings(tmp_path / "town.sdf", None, None, ("f", "k")).left_out
    assert left_out == {
        "include": 1,
        "model that is not static": 1,
        "box above the floor": 1,
        "tilted box": 1,
        "mesh": 1,
    }


def test_robots_start_clear_of_buildings(tmp_path):
    (tmp_path / "town.sdf").write_text(SDF.replace("<radius>0.25</radius>", "<radius>5.5</radius>"))
    world = world_of(tmp_path, {"size_m": [12.0, 12.0], "buildings": {"file": "town.sdf"}}, *range(20))
    away_m = np.hypot(world.pose[:, 0] - 0.5, world.pose[:, 1] - 1.0)
    assert (away_m > 5.5 + 0.035).all()


def test_unusable_file_of_buildings_is_refused(tmp_path):
    def assert_refused(where: Any, key: str, text: str, name: str = "town.geojson", **table: Any) -> None:
        (tmp_path / name).write_text(text)
        with refused_input(where, key):
            world_of(tmp_path, {"size_m": [9.0, 9.0], "buildings": {"file": name, **table}})

    scenario, path = tmp_path / "maze.toml", tmp_path / "town.geojson"
    with refused_input(scenario, "arena.buildings"):
        world_of(tmp_path, {"buildings": {"file": "none.sdf"}})
    for text in ("", "[]", "{}", '{"type": "FeatureCollection", "features": [{}]}'):
        assert_refused(path, "", text)
    bow_tie = feature([[0, 0], [1, 1], [1, 0], [0, 1], [0, 0]])
    assert_refused(path, "polygon 0", json.dumps(bow_tie))
    assert_refused(scenario, "arena.buildings", json.dumps({"type": "FeatureCollection", "features": []}))
    odd = {"type": "Feature", "properties": {}, "geometry": {"type": "Circle", "coordinates": [0, 0]}}
    assert_refused(path, "", json.dumps(odd))
    house = feature([[8.5, 47.4], [8.5001, 47.4], [8.5001, 47.4001], [8.5, 47.4001], [8.5, 47.4]])
    assert_refused(path, "polygon 0", json.dumps(house))  # in degrees, without an origin
    for size in ("3 -1 1", "3 0 1", "3 nan 1", "3 inf 1"):
        assert_refused(tmp_path / "town.sdf", "size", SDF.replace("3 0.2 1", size), "town.sdf")
    nested = "<model name='m'><static>true</static>" * 200 + "</model>" * 200
    assert_refused(tmp_path / "town.sdf", "model", f"<sdf><world>{nested}</world></sdf>", "town.sdf")
    assert_refused(tmp_path / "town.sdf", "", "<sdf>", "town.sdf")
    assert_refused(tmp_path / "town.sdf", "urdf", "<urdf/>", "town.sdf")
    assert_refused(tmp_path / "town.sdf", "size", SDF.replace("3 0.2 1", "3 wide 1"), "town.sdf")
    assert_refused(tmp_path / "town.sdf", "pose", SDF.replace("2 0 0.5 0 0 0", "2 0"), "town.sdf")
    assert_refused(scenario, "arena.buildings", SDF, "town.sdf", origin=[48.0, 11.0])
    saved(tmp_path, feature(BLOCK))
    for size in ({}, {"size_m": [9.0, 9.0]}):  # a block in degrees, hundreds of kilometres from the origin
        with refused_input(scenario, "arena.buildings"):
            world_of(tmp_path, {"buildings": {"file": "town.geojson", "origin": [0.0, 0.0]}, **size})

"""Maps of Nav2: cells as nav2_map_server reads them, and their place in the arena."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from PIL import Image

from swarmwire.world.placement import maps
from swarmwire.world.placement.nav2_map import read_nav2_map
from swarmwire.world.world import World
from tests.support.refusals import refused_input
from tests.unit.world.placement.test_layout import world_of

SERVER = Path(__file__).parent / "nav2_map_server"
# g_valid_image_content of nav2_map_server/test/test_constants.cpp: the lowest row first
TESTMAP = """
0 0 0 0 0 0 0 0 0 0
100 100 100 100 0 0 100 100 100 0
100 100 100 100 0 0 100 100 100 0
100 0 0 0 0 0 0 0 0 0
100 0 0 0 0 0 0 0 0 0
100 0 0 0 0 0 100 100 0 0
100 0 0 0 0 0 100 100 0 0
100 0 0 0 0 0 100 100 0 0
100 0 0 0 0 0 100 100 0 0
100 0 0 0 0 0 0 0 0 0
"""
THRESHOLDS = {"resolution": 0.1, "origin": [0, 0, 0], "negate": 0, "occupied_thresh": 0.65, "free_thresh": 0.196}
RAMP = np.arange(256, dtype=np.uint8).reshape(16, 16)
SLAM = np.full((60, 80), 205, np.uint8)  # 4 m x 3 m of unknown cells, 205, around a room of 1 m x 0.8 m
SLAM[20:38, 40:62] = 0
SLAM[21:37, 41:61] = 254


def saved(folder: Path, picture: str, **keys: Any) -> Path:
    path = folder / "map.yaml"
    path.write_text(yaml.safe_dump({"image": picture, **THRESHOLDS, **keys}))
    return path


def cells_of(path: Path) -> Any:
    return read_nav2_map(path, "scenario.toml", "arena.map").cells


def reference(grey: Any, mode: str, negate: bool, occupied: float, free: float) -> int:
    """The value of an opaque cell, after loadMapFromFile in map_io.cpp of ros-navigation/navigation2, a3a97043."""
    if mode == "raw":
        return int(grey) if grey <= 100 else -1
    occupancy = np.float32(grey) / np.float32(255)
    occupancy = occupancy if negate else np.float32(1) - occupancy
    if occupancy <= np.float32(free):
        return 0
    if occupancy >= np.float32(occupied):
        return 100
    return math.floor((occupancy - free) / (occupied - free) * 100 + 0.5) if mode == "scale" else -1


@pytest.mark.parametrize("picture", ["testmap.pgm", "testmap.png"])
def test_nav2_map_of_its_own_tests_has_the_cells_that_these_expect(tmp_path, picture):
    keys = yaml.safe_load((SERVER / "testmap.yaml").read_text())
    (tmp_path / "map.yaml").write_text(yaml.safe_dump({**keys, "image": str(SERVER / picture)}))
    expected = np.array(TESTMAP.split(), int).reshape(10, 10)[::-1]
    assert np.array_equal(cells_of(tmp_path / "map.yaml"), expected)


@pytest.mark.parametrize("mode", ["trinary", "Scale", "raw"])
@pytest.mark.parametrize("negate", [0, True])
@pytest.mark.parametrize(("occupied", "free"), [(0.65, 0.196), (0.9, 0.1), (0.3, 0.6), (1.0, 0.0)])
def test_nav2_cells_of_each_grey_follow_mode_and_thresholds(tmp_path, mode, negate, occupied, free):
    (tmp_path / "map.pgm").write_bytes(b"P5\n# CREATOR\n16 16\n# 0.05 m/pix\n255\n" + RAMP.tobytes())
    path = saved(tmp_path, "map.pgm", mode=mode, negate=negate, occupied_thresh=occupied, free_thresh=free)
    expected = [reference(grey, mode.lower(), bool(negate), occupied, free) for grey in RAMP.ravel()]
    assert cells_of(path).ravel().tolist() == expected


def test_nav2_cells_are_equal_in_all_formats_and_unknown_where_transparent(tmp_path):
    """The greys of colours were read with GraphicsMagick 1.3.40, which nav2_map_server uses; it rounds down."""
    raw = np.where(RAMP <= 100, RAMP.astype(int), -1)
    Image.fromarray(RAMP).save(tmp_path / "8.png")
    Image.fromarray(RAMP.astype(np.uint16) * 257 + 255).save(tmp_path / "16.png")  # 255 / 257 of a grey value more
    (tmp_path / "16.pgm").write_bytes(b"P5 16 16 65535\n" + (RAMP.astype(">u2") * 257).tobytes())
    (tmp_path / "text.pgm").write_text("P2\n# drawn\n16 16\n255\n" + "\n".join(map(str, RAMP.ravel())) + "\n")
    for name in ("8.png", "16.pgm", "text.pgm"):
        assert np.array_equal(cells_of(saved(tmp_path, name, mode="raw")), raw), name
    assert np.array_equal(cells_of(saved(tmp_path, "16.png", mode="raw"))[:15], raw[:15])
    colors = np.array([[[242, 127, 219], [222, 37, 60], [129, 14, 211], [0, 0, 0]]], np.uint8)
    Image.fromarray(colors).save(tmp_path / "rgb.png")
    assert cells_of(saved(tmp_path, "rgb.png", mode="raw")).tolist() == [[-1, 94, 70, 0]]  # 171, 94.9, 70.8
    opacity = np.array([[255, 254, 128, 0]], np.uint8)
    Image.fromarray(np.dstack([np.zeros((1, 4, 3), np.uint8), opacity])).save(tmp_path / "clear.png")
    Image.fromarray(np.dstack([np.zeros((1, 4), np.uint8), opacity])).save(tmp_path / "clear-grey.png")
    for name in ("clear.png", "clear-grey.png"):
        assert cells_of(saved(tmp_path, name)).tolist() == [[100, -1, -1, -1]]
        assert cells_of(saved(tmp_path, name, mode="raw")).tolist() == [[0, 0, 0, 0]]


def covered(world: World, x_m: float, y_m: float) -> int:
    """Number of obstacles over a point."""
    count = 0
    for box in world.static.obstacles[0]:
        c, s = math.cos(box.heading_rad), math.sin(box.heading_rad)
        dx, dy = x_m - box.x_m, y_m - box.y_m
        along, across = abs(c * dx + s * dy), abs(c * dy - s * dx)
        count += along < 0.5 * box.size_m[0] and across < 0.5 * box.size_m[1]
    return count


@pytest.mark.parametrize("origin", [[-2.0, -1.0, 0.0], [0.5, 0.7, 0.0], [-1.03, -0.42, 0.6], [1.0, -2.0, -2.5]])
@pytest.mark.parametrize("size_m", [None, [8.0, 11.0]])
def test_nav2_map_lies_at_its_origin_and_all_but_free_cells_are_blocked(tmp_path, origin, size_m):
    Image.fromarray(SLAM).save(tmp_path / "slam.png")
    saved(tmp_path, "slam.png", resolution=0.05, origin=origin)
    world = world_of(tmp_path, {"map": "map.yaml"} | ({"size_m": size_m} if size_m else {}))
    width_m, height_m = world.static.arena_size_m
    free, farthest_m = 0, [0.0, 0.0]
    for row in range(-40, 100, 3):
        for column in range(-40, 120, 3):
            along, up = 0.05 * (column + 0.5), 0.05 * (60 - row - 0.5)
            x = origin[0] + math.cos(origin[2]) * along - math.sin(origin[2]) * up
            y = origin[1] + math.sin(origin[2]) * along + math.cos(origin[2]) * up
            if abs(x) > 0.5 * width_m or abs(y) > 0.5 * height_m:
                continue
            is_free = 21 <= row < 37 and 41 <= column < 61
            free += is_free
            assert covered(world, x, y) == (not is_free)
    assert free > 20
    for row, column in ((20, 40), (20, 62), (38, 40), (38, 62)):  # corners of the known cells
        along, up = 0.05 * column, 0.05 * (60 - row)
        x = origin[0] + math.cos(origin[2]) * along - math.sin(origin[2]) * up
        y = origin[1] + math.sin(origin[2]) * along + math.cos(origin[2]) * up
        farthest_m = [max(farthest_m[0], abs(x)), max(farthest_m[1], abs(y))]
    expected = size_m or [2.0 * end_m for end_m in farthest_m]
    assert world.static.arena_size_m == pytest.approx(expected, abs=1e-5)
    assert covered(world, *world.pose[0, :2]) == 0


def test_unusable_nav2_map_is_refused(tmp_path, monkeypatch):
    Image.fromarray(SLAM).save(tmp_path / "slam.png")
    scenario, path = tmp_path / "maze.toml", tmp_path / "map.yaml"

    def assert_refused(where: Path, key: str, **keys: Any) -> None:
        saved(tmp_path, **{"picture": "slam.png", **keys})
        with refused_input(where, key):
            world_of(tmp_path, {"map": "map.yaml"})

    with refused_input(scenario, "arena.map"):
        world_of(tmp_path, {"map": "none.yaml"})
    for text in ("image: [", "- a", "\x00", "[" * 2000):
        path.write_text(text)
        with refused_input(scenario, "arena.map"):
            world_of(tmp_path, {"map": "map.yaml"})
    path.write_text(yaml.safe_dump({"image": "slam.png", "resolution": 0.05, "origin": [0, 0, 0]}))
    with refused_input(path, "negate"):
        world_of(tmp_path, {"map": "map.yaml"})
    assert_refused(path, "image", picture="none.png")
    assert_refused(path, "resolution", resolution=0)
    assert_refused(path, "resolution", resolution="wide")
    assert_refused(path, "origin", origin=[0, 0])
    assert_refused(path, "origin", origin=[0, math.nan, 0])
    assert_refused(path, "origin", origin=[1e300, 0, 0])
    assert_refused(path, "mode", mode="binary")
    assert_refused(scenario, "arena.map", free_thresh=-1.0)
    assert_refused(scenario, "arena.map", origin=[90_000, 0, 0])
    monkeypatch.setattr(maps, "MAX_BOXES", 3)
    assert_refused(scenario, "arena.map")

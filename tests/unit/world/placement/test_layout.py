"""Layouts of the arena."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.extra import numpy as npst
from numpy.typing import NDArray
from PIL import Image

from swarmwire.comms.base.arrays import BoolArray
from swarmwire.comms.base.geometry.floor import Patch
from swarmwire.world.placement import maps, pictures
from swarmwire.world.placement.maps import merged_boxes
from swarmwire.world.placement.pictures import read_grey
from swarmwire.world.scenario_file import load_scenario, scenario_from
from swarmwire.world.world import World
from tests.support.refusals import refused_input
from tests.support.world.scenes import SAMPLE, changed

GREY = np.full((20, 40), 254, np.uint8)
GREY[:, 0] = GREY[0] = 0
GREY[10:12, 5:30] = 100
NO_ROOM = [  # path, value, key, text
    ("robots.flock.place", {"how": "disc", "radius_m": 0.8, "apart_m": 0.6}, "robots.flock.place", r"flock-\d+"),
    ("arena.obstacles.0.apart_m", 3.0, "arena.obstacles.0", "cylinder 3 of 4"),
    (
        "arena.obstacles.0.within",
        {"how": "disc", "radius_m": 0.5, "at": [9.0, 0.0]},
        "arena.obstacles.0",
        "cylinder 1 of 4",
    ),
    ("arena.lights.0.apart_m", 5.5, "arena.lights.0", "light [12] of 2"),
    ("robots.flock.place.radius_m", 0.08, "robots.flock.place", r"flock-\d+"),
    ("arena.obstacles.0.radius_m", 1.5, "arena.obstacles.0", "cylinder 2 of 4"),
    ("arena.lights", [{"intensity": 1.0, "at": [1.0, 1.04]}], "arena.lights.0", r"light 1 of 1 .*: at \(1, 1.04\)"),
    ("arena.lights", [{"intensity": 1.0, "at": [3.1, 0]}], "arena.lights.0", r"at \(3.1, 0\)"),
    ("robots.flock.place", {"how": "grid", "spacing_m": 2.0}, "robots.flock.place", "flock-0 with seed 1: at "),
    ("robots.flock.place", {"how": "poses", "poses": [[0, 0, 0]] * 12}, "robots.flock.place", r"flock-1 .*at \(0, 0\)"),
]


def written(folder: Path, arena: dict[str, Any]) -> Path:
    """A scenario beside its pictures, with one robot."""
    import tomli_w

    robots = {"a": {"body": "epuck", "count": 1, "agent": "x:Y"}}
    mapping = {"format": 1, "name": "map", "duration_s": 1.0, "arena": arena, "robots": robots}
    path = folder / "maze.toml"
    path.write_text(tomli_w.dumps(mapping))
    return path


def world_of(folder: Path, arena: dict[str, Any], *seeds: int) -> World:
    return World(load_scenario(written(folder, arena)), seeds or (1,), {})


def saved(folder: Path, name: str, grey: Any, mode: str | None = None) -> str:
    image = Image.fromarray(grey)
    (image.convert(mode) if mode else image).save(folder / name)
    return name


def painted(boxes: Any, shape: tuple[int, int]) -> Any:
    """Number of boxes over each pixel."""
    count = np.zeros(shape, np.int64)
    for row, column, rows, columns in boxes:
        count[row : row + rows, column : column + columns] += 1
    return count


@settings(max_examples=60)
@given(npst.arrays(np.bool_, npst.array_shapes(min_dims=2, max_dims=2, max_side=12)))
def test_merged_boxes_cover_each_dark_pixel_once_and_no_other(occupied: BoolArray) -> None:
    boxes = merged_boxes(occupied, 200)
    assert np.array_equal(painted(boxes, occupied.shape), occupied)
    assert np.array_equal(boxes, merged_boxes(occupied, 200))


def test_merged_boxes_of_a_maze_are_few() -> None:
    """A maze of 20 x 20 rooms, 9 pixels wide between walls of 1; each is open to the right or below."""
    walls = np.zeros((201, 201), np.bool_)
    walls[::10] = walls[:, ::10] = True
    for room in range(399):
        row, column = 10 * (room // 20), 10 * (room % 20)
        if row < 190 and (column == 190 or (room * 7919) % 13 < 6):
            walls[row + 10, column + 1 : column + 10] = False
        else:
            walls[row + 1 : row + 10, column + 10] = False
    boxes = merged_boxes(walls, 10_000)
    assert np.array_equal(painted(boxes, walls.shape), walls)
    assert len(boxes) < 400
    assert len(merged_boxes(walls, 50)) == 51


@pytest.mark.parametrize("name", ["maze.png", "maze.pgm", "maze.bmp"])
def test_map_sets_the_arena_size_and_boxes_at_dark_pixels(tmp_path: Path, name: str) -> None:
    table = {"image": saved(tmp_path, name, GREY), "resolution_m": 0.1, "height_m": 0.3}
    world = world_of(tmp_path, {"map": table}, 1, 2)
    assert world.static.arena_size_m == pytest.approx((4.0, 2.0))
    assert world.static.obstacles[0] == world.static.obstacles[1]
    corners = [obstacle.corners_m for obstacle in world.static.obstacles[0]]
    ends = {tuple(np.round([*c.min(0), *c.max(0)], 9)) for c in corners}
    assert ends == {(-2.0, 0.9, 2.0, 1.0), (-2.0, -1.0, -1.9, 0.9), (-1.5, -0.2, 1.0, 0.0)}
    assert {obstacle.height_m for obstacle in world.static.obstacles[0]} == {0.3}
    as_dark = world_of(tmp_path, {"map": {**table, "occupied_below": float(np.float32(100) / np.float32(255))}})
    assert len(as_dark.static.obstacles[0]) == 2  # a pixel as bright as this is free
    only_black = world_of(tmp_path, {"map": {**table, "occupied_below": 0.39}, "size_m": [4.0, 2.0]})
    assert len(only_black.static.obstacles[0]) == 2


def test_random_obstacles_and_lights_keep_clear_of_the_map(tmp_path: Path) -> None:
    arena: dict[str, Any] = {"map": {"image": saved(tmp_path, "maze.png", GREY), "resolution_m": 0.1}}
    arena["obstacles"] = [{"shape": "cylinder", "radius_m": 0.1, "count": 8, "place": "random"}]
    arena["lights"] = [{"intensity": 1.0, "count": 30, "place": "random"}]
    first, second = world_of(tmp_path, arena, 1, 2).static.obstacles
    assert first[:3] == second[:3]
    assert {obstacle.shape for obstacle in first[3:]} == {"cylinder"}
    assert set(first[3:]).isdisjoint(second[3:])
    static = world_of(tmp_path, arena).static
    points = [(o.x_m, o.y_m, o.radius_m) for o in static.obstacles[0][3:]]
    points += [(light.x_m, light.y_m, 0.0) for light in static.lights[0]]
    for x, y, radius in points:
        for box in static.obstacles[0][:3]:
            beyond = np.abs((x - box.x_m, y - box.y_m)) - 0.5 * np.array(box.size_m)
            assert np.hypot(*np.maximum(beyond, 0.0)) > radius


def test_grey_values_are_equal_in_all_picture_formats(tmp_path: Path) -> None:
    ramp = np.arange(256, dtype=np.uint8).reshape(16, 16)
    saved(tmp_path, "8.png", ramp)
    saved(tmp_path, "rgb.png", ramp, "RGB")
    saved(tmp_path, "16.png", ramp.astype(np.uint16) * 257)
    (tmp_path / "16.pgm").write_bytes(b"P5 16 16 65535\n" + (ramp.astype(">u2") * 257).tobytes())
    (tmp_path / "ascii.pgm").write_text("P2\n# a comment\n16 16 255\n" + " ".join(map(str, ramp.ravel())))
    for name in ("8.png", "rgb.png", "16.png", "16.pgm", "ascii.pgm"):
        assert read_grey(tmp_path / name, "f", "k") == pytest.approx(ramp / 255.0, abs=1e-6), name
    clear = np.dstack([np.zeros_like(ramp)] * 3 + [ramp])  # black, of rising opacity
    saved(tmp_path, "clear.png", clear)
    assert read_grey(tmp_path / "clear.png", "f", "k") == pytest.approx(1.0 - ramp / 255.0, abs=0.003)


def test_floor_has_its_picture_and_patches(tmp_path: Path) -> None:
    disc = {"shape": "disc", "at": [0.5, 0.0], "radius_m": 0.3, "shade": 0.0}
    corner = {"shape": "polygon", "points": [[0, 0], [0, 1], [1, 0]], "shade": 0.25}
    table = {"image": saved(tmp_path, "floor.png", GREY), "shade": 0.5, "patches": [disc, corner]}
    floor = world_of(tmp_path, {"size_m": [4.0, 2.0], "ground": table}).static.floor
    assert floor is not None
    assert floor.image is not None
    assert np.array_equal(floor.image.grey, GREY)
    assert floor.patches == (
        Patch("disc", 0.5, 0.0, 0.0, radius_m=0.3),
        Patch("polygon", 0.0, 0.0, 0.25, points_m=((1.0, 0.0), (0.0, 1.0), (0.0, 0.0))),
    )
    assert floor.shade == 0.5
    assert world_of(tmp_path, {"size_m": [4.0, 2.0]}).static.floor is None


def test_unusable_map_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def assert_refused(name: str, match: str = "", key: str = "map.image", **tables: Any) -> None:
        table = {"image": name, "resolution_m": 0.1, **tables.pop("map", {})}
        with refused_input(tmp_path / "maze.toml", f"arena.{key}", match or f"expected a picture, .*{name}$"):
            load_scenario(written(tmp_path, {"map": table, **tables}))

    assert_refused("none.png", "there is no .*none.png$")
    (tmp_path / "text.png").write_text("no picture")
    (tmp_path / "folder.png").mkdir()
    (tmp_path / "bad.pgm").write_text("P2 2 2 255 1 2 x 4")
    for name in ("text.png", "folder.png", "bad.pgm"):
        assert_refused(name)
    data = (tmp_path / saved(tmp_path, "maze.png", np.arange(5000, dtype=np.uint8).reshape(50, 100))).read_bytes()
    for size in (3, 20, 40, 60, len(data) // 2, len(data) - 30):
        (tmp_path / "cut.png").write_bytes(data[:size])
        assert_refused("cut.png")
    assert_refused(saved(tmp_path, "full.png", np.zeros((4, 4), np.uint8)), "free space")
    good = saved(tmp_path, "good.png", GREY)
    assert_refused(good, "the size of the map", "size_m", size_m=[4.0, 2.1])
    assert_refused(good, "at most 10000 m", "map.resolution_m", map={"resolution_m": 300.0})
    monkeypatch.setattr(maps, "MAX_BOXES", 2)
    assert_refused(good, "at most 2 boxes")
    monkeypatch.setattr(pictures, "MAX_PIXELS", 799)
    assert_refused(good, "at most 799 pixels")
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 100)
    assert_refused(good, "at most 799 pixels")
    with refused_input(tmp_path / "maze.toml", "arena.ground.image", "there is no .*none.png$"):
        load_scenario(written(tmp_path, {"size_m": [4.0, 2.0], "ground": {"image": "none.png"}}))


def test_fixed_obstacle_outside_the_map_is_refused(tmp_path: Path) -> None:
    table = {"image": saved(tmp_path, "maze.png", GREY), "resolution_m": 0.1}
    outside = {"shape": "cylinder", "radius_m": 0.1, "at": [2.0, 0.0]}
    with refused_input(tmp_path / "maze.toml", "arena.obstacles.0"):
        load_scenario(written(tmp_path, {"map": table, "obstacles": [outside]}))


def test_obstacle_heights_are_those_of_the_file() -> None:
    low = World(scenario_from(changed("arena.obstacles.1.height_m", 0.2), "f"), (1,), {}).static.obstacles[0]
    assert [obstacle.height_m for obstacle in low] == [np.inf] * 4 + [0.2] + [np.inf] * 2
    assert SAMPLE["arena"]["obstacles"][1].get("height_m") is None


@pytest.mark.parametrize(("path", "value", "key", "text"), NO_ROOM)
def test_placement_without_room_is_refused(path: str, value: Any, key: str, text: str) -> None:
    mapping = changed(path, value)
    if "robots" in path:
        mapping["arena"]["obstacles"] = []
    with refused_input("file.toml", key, f"no room for .*{text}"):
        World(scenario_from(mapping, "file.toml"), [1], {})


def _hint(folder: Path, grey: NDArray[np.uint8], **table: float) -> tuple[list[str], World]:
    """The hint of a map in a scenario of 20 robots, and its world."""
    arena = {"map": {"image": saved(folder, "slam.pgm", grey), "resolution_m": 0.05, **table}}
    robots = {"flock": {"body": "epuck", "count": 20, "agent": "swarmwire.agent.behaviours:Avoidance"}}
    scenario = scenario_from(
        {"format": 1, "name": "s", "seed": 1, "duration_s": 1.0, "arena": arena, "robots": robots},
        str(folder / "s.toml"),
    )
    return maps.layout_hints(scenario.arena, scenario.source), World(scenario, [1], {})


@pytest.mark.parametrize(("occupied_below", "free"), [(0.5, True), (0.8, True), (0.9, False)])
def test_unknown_cells_of_a_slam_map_are_free_with_a_hint_or_obstacles(tmp_path, occupied_below, free):
    grey = np.full((120, 120), 205, np.uint8)  # 6 m x 6 m
    grey[44:76, 44:76] = 0
    grey[45:75, 45:75] = 254  # a room of 1.5 m x 1.5 m, the middle of the arena
    hint, world = _hint(tmp_path, grey, occupied_below=occupied_below)
    assert bool(hint) == free
    assert (np.abs(world.pose[..., :2]) < 0.75).all() != free


@pytest.mark.parametrize(("shade", "rows", "hinted"), [(205, 11, True), (205, 10, False), (206, 19, False)])
def test_map_hint_names_unknown_cells_that_are_most_of_the_map(tmp_path, shade, rows, hinted):
    grey = np.full((20, 20), 254, np.uint8)
    grey[:rows] = shade
    assert (_hint(tmp_path, grey)[0] != []) == hinted

"""Placement of robots, obstacles and lights."""

import copy
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.observe.truth import Light, Static
from swarmwire.world.scenario_file import scenario_from
from swarmwire.world.world import World
from tests.support.world.scenes import SAMPLE, changed, rim


def built(mapping: dict[str, Any], *seeds: int) -> World:
    return World(scenario_from(mapping, "file.toml"), seeds, {})


def depth(obstacle: Obstacle, points: FloatArray) -> FloatArray:
    """Distance of points (k, 2) from the rim of an obstacle, in m; negative inside."""
    if obstacle.shape == "cylinder":
        return np.hypot(points[:, 0] - obstacle.x_m, points[:, 1] - obstacle.y_m) - obstacle.radius_m
    corners = obstacle.corners_m
    along = np.roll(corners, -1, axis=0) - corners
    to = points[:, None] - corners
    beyond = (to[..., 0] * along[:, 1] - to[..., 1] * along[:, 0]) / np.hypot(*along.T)
    share = np.clip((to * along).sum(2) / (along**2).sum(1), 0.0, 1.0)
    to_rim = np.hypot(*(to - share[..., None] * along).transpose(2, 0, 1)).min(1)
    return np.where(beyond.max(1) <= 0.0, -to_rim, to_rim)


def radii(static: Static) -> FloatArray:
    return np.concatenate([np.full(g.stop - g.start, g.body.radius_m) for g in static.groups])


def check_apart(world: World) -> None:
    static = world.static
    radius, half = radii(static), 0.5 * np.array(static.arena_size_m)
    for arena, obstacles in enumerate(static.obstacles):
        xy = world.pose[arena * static.robots :][: static.robots, :2]
        assert np.all(np.abs(xy) + radius[:, None] <= half)
        distance = np.hypot(*(xy[:, None] - xy).transpose(2, 0, 1)) + 10.0 * np.eye(len(xy))
        assert np.all(distance >= radius[:, None] + radius)
        for i, obstacle in enumerate(obstacles):
            assert np.all(np.abs(rim(obstacle, 200)) <= half + 1e-9)
            assert np.all(depth(obstacle, xy) >= radius)
            lit = np.array([[light.x_m, light.y_m] for light in static.lights[arena]])
            assert np.all(depth(obstacle, lit) > 0.0)
            for second in obstacles[:i]:
                assert np.all(depth(second, rim(obstacle, 200)) > 0.0)
                assert np.all(depth(obstacle, rim(second, 200)) > 0.0)


PLACEMENTS = st.sampled_from(
    [{"how": "disc", "radius_m": 1.2}, {"how": "arena"}, {"how": "disc", "radius_m": 0.8, "at": [0.5, -0.5]}]
)
OBSTACLES = st.lists(
    st.sampled_from(
        [
            {"shape": "cylinder", "radius_m": 0.15, "count": 5, "place": "random"},
            {"shape": "box", "size_m": [0.4, 0.1], "count": 4, "place": "random"},
            {"shape": "box", "size_m": [0.3, 0.3], "heading_rad": 0.5, "count": 2, "place": "random"},
            {"shape": "box", "size_m": [0.1, 2.0], "at": [1.4, 0.0]},
            {"shape": "polygon", "points": [[0.1, 0.0], [0.4, 0.0], [0.2, 0.3]], "count": 5, "place": "random"},
            {"shape": "polygon", "points": [[0, 1], [0, 0], [0.3, 0.3]], "at": [-2.0, 0.5], "heading_rad": 1.0},
        ]
    ),
    max_size=3,
    unique_by=str,
)


@settings(max_examples=40)
@given(seed=st.integers(0, 2**63 - 1), placement=PLACEMENTS, obstacles=OBSTACLES)
def test_placement_overlaps_nothing(seed: int, placement: dict[str, Any], obstacles: list[dict[str, Any]]) -> None:
    mapping = changed("robots.flock.place", placement)
    mapping["arena"]["obstacles"] = obstacles
    world = built(mapping, seed)
    check_apart(world)
    if placement["how"] == "disc":
        assert np.all(np.hypot(*(world.pose[:12, :2] - placement.get("at", (0.0, 0.0))).T) <= placement["radius_m"])


def test_placement_depends_only_on_the_seed_of_the_arena() -> None:
    many = built(SAMPLE, 5, 6, 7)
    one_group = built(SAMPLE, 6)
    assert many.static.obstacles[1] == one_group.static.obstacles[0]
    assert np.array_equal(many.pose[15:30], one_group.pose)
    assert not np.array_equal(many.pose[:15], many.pose[15:30])


def test_placement_of_a_group_does_not_depend_on_later_groups() -> None:
    before, after = built(SAMPLE, 1), built(changed("robots.big.count", 6), 1)
    assert np.array_equal(before.pose[:12], after.pose[:12])
    assert np.array_equal(before.pose[12:15], after.pose[12:15])


def test_lights_change_no_other_placement() -> None:
    lights = [{"intensity": 1.0, "at": [0.5, 0.0]}, {"intensity": 3.0, "place": "random", "count": 3}]
    lit, dark = built(changed("arena.lights", lights), 1, 2), built(changed("arena.lights", []), 1, 2)
    assert lit.static.obstacles == dark.static.obstacles
    assert np.array_equal(lit.pose, dark.pose)
    assert dark.static.lights == ((), ())
    first, second = lit.static.lights
    assert [light.intensity_m for light in first] == [1.0, 3.0, 3.0, 3.0]
    assert first[0] == second[0] == Light(0.5, 0.0, 1.0)
    assert len({(light.x_m, light.y_m) for light in (*first, *second)}) == 7
    assert built(changed("arena.lights", lights), 2).static.lights[0] == second
    assert built(changed("arena.lights", [{**lights[1], "count": 1}]), 1).static.lights[0] != first[1:2]


def test_polygon_with_the_corners_of_a_box_is_placed_like_the_box() -> None:
    box = {"shape": "box", "size_m": [0.4, 0.1], "count": 12, "place": "random"}
    corners = [[-0.2, -0.05], [-0.2, 0.05], [0.2, 0.05], [0.2, -0.05]]  # clockwise
    polygon = {**{key: box[key] for key in ("count", "place")}, "shape": "polygon", "points": corners}
    boxes, polygons = (built(changed("arena.obstacles", [kind]), 4) for kind in (box, polygon))
    for first, second in zip(boxes.static.obstacles[0], polygons.static.obstacles[0], strict=True):
        assert (first.x_m, first.y_m, first.heading_rad) == (second.x_m, second.y_m, second.heading_rad)
        assert (first.shape, second.shape) == ("box", "polygon")
        assert {tuple(corner) for corner in first.corners_m} == {tuple(corner) for corner in second.corners_m}
    assert np.array_equal(boxes.pose, polygons.pose)


def test_robots_fill_a_disc_and_all_headings_evenly() -> None:
    mapping = changed(
        "robots.flock", {"body": "epuck", "count": 2000, "agent": "x", "place": {"how": "disc", "radius_m": 20}}
    )
    mapping["arena"] = {"size_m": [60, 60]}
    pose = built(mapping, 1).pose[:2000]
    # Shares of a half have a standard deviation of 0.011: 4 of them give a false alarm in 16,000.
    assert abs(np.mean(np.hypot(pose[:, 0], pose[:, 1]) < 20 / np.sqrt(2)) - 0.5) < 0.045
    assert abs(np.mean(pose[:, 1] > 0) - 0.5) < 0.045
    assert abs(np.mean(pose[:, 2] > 0) - 0.5) < 0.045
    assert abs(np.mean(np.abs(pose[:, 2]) < np.pi / 2) - 0.5) < 0.045


def one_group(placement: dict[str, Any], count: int = 12, **arena: Any) -> dict[str, Any]:
    """A scenario with one group of e-pucks in 6 x 4 m unless `arena` has another size."""
    group = {"body": "epuck", "count": count, "agent": "x", "place": placement}
    mapping = changed("robots", {"flock": group})
    mapping["arena"] = {"size_m": [6.0, 4.0], **arena}
    return mapping


def gaps(world: World, wrapped: bool = False) -> FloatArray:
    """Gaps between the robots of the first arena, (pairs,), in m."""
    xy, radius = world.pose[: world.static.robots, :2], radii(world.static)
    away = xy[:, None] - xy
    if wrapped:
        size = np.array(world.static.arena_size_m)
        away -= size * np.round(away / size)
    distance = np.hypot(*away.transpose(2, 0, 1)) - radius[:, None] - radius
    return distance[np.triu_indices(len(xy), 1)]


def test_grid_is_centred_and_evenly_spaced() -> None:
    xy = built(one_group({"how": "grid", "spacing_m": 0.3}, 6), 1).pose[:, :2]
    assert np.allclose(xy, [[-0.3, -0.15], [0, -0.15], [0.3, -0.15], [-0.3, 0.15], [0, 0.15], [0.3, 0.15]])


def test_poses_are_used_with_wrapped_headings() -> None:
    pose = built(one_group({"how": "poses", "poses": [[0.0, 0.0, 0.5], [0.3, 0.0, 4.0]]}, 2), 1).pose
    assert np.allclose(pose, [[0, 0, 0.5], [0.3, 0, 4.0 - 2 * np.pi]])


RING: dict[str, Any] = {"how": "ring", "inner_radius_m": 1.0, "radius_m": 1.5, "at": [0.5, 0.2]}
BOX: dict[str, Any] = {"how": "box", "size_m": [1.0, 3.0], "at": [-1.0, 0.2]}


def test_robots_fill_a_ring_evenly() -> None:
    world = built(one_group({**RING, "radius_m": 9.0}, 800, size_m=[30, 30]), 1)
    x, y = (world.pose[:, :2] - RING["at"]).T
    distance = np.hypot(x, y)
    assert (distance.min() >= 1.0, distance.max() <= 9.0) == (True, True)
    # Shares of a half have a standard deviation of 0.018: 4 of them give a false alarm in 16,000.
    for half in (distance**2 < (1.0 + 81.0) / 2, x > 0, y > 0, x > y):
        assert abs(np.mean(half) - 0.5) < 0.072


def test_robots_stand_within_their_box_or_ring() -> None:
    for seed in range(1, 6):
        x, y = (built(one_group(BOX), seed).pose[:, :2] - BOX["at"]).T
        assert np.all((np.abs(x) <= 0.5) & (np.abs(y) <= 1.5))
        x, y = (built(one_group(RING), seed).pose[:, :2] - RING["at"]).T
        assert np.all((np.hypot(x, y) >= 1.0) & (np.hypot(x, y) <= 1.5))


@pytest.mark.parametrize("placement", [{"how": "arena"}, {"how": "disc", "radius_m": 1.8}, BOX, RING])
def test_robots_keep_their_distance_of_apart_m(placement: dict[str, Any]) -> None:
    obstacles = [
        {"shape": "cylinder", "radius_m": 0.2, "at": [0.5, 1.4]},
        {"shape": "box", "size_m": [0.2, 1], "at": [-1, 0]},
    ]
    nearest = []
    for seed in range(1, 9):
        world = built(one_group({**placement, "apart_m": 0.2}, obstacles=obstacles), seed)
        xy = world.pose[:, :2]
        nearest.append(gaps(world).min())
        nearest += [depth(obstacle, xy).min() - 0.035 for obstacle in world.static.obstacles[0]]
        assert min(nearest) >= 0.2 - 1e-12
    assert min(nearest) < 0.25  # the distance is no larger


def test_apart_m_counts_for_robots_placed_before_but_not_after() -> None:
    mapping = changed("robots.big.place", {"how": "arena", "apart_m": 0.5})
    mapping["arena"]["obstacles"] = []
    both = [built(mapping, seed) for seed in range(1, 9)]
    size = both[0].static.robots
    index = np.array([(i, j) for i in range(size) for j in range(i + 1, size)])
    late = index[:, 1] >= 12  # a foot-bot with an e-puck or another foot-bot
    assert min(gaps(world)[late].min() for world in both) >= 0.5 - 1e-12
    assert min(gaps(world)[~late].min() for world in both) < 0.2


def test_random_obstacles_and_lights_keep_apart_and_stay_within() -> None:
    kinds = [
        {"shape": "cylinder", "radius_m": 0.1, "count": 6, "apart_m": 0.25},
        {"shape": "box", "size_m": [0.3, 0.1], "count": 5, "apart_m": 0.25},
        {"shape": "polygon", "points": [[0, 0], [0.3, 0], [0, 0.2]], "count": 5, "apart_m": 0.25, "within": BOX},
    ]
    lights = [{"intensity": 1.0, "count": 5, "apart_m": 0.4, "within": RING}]
    fixed = {"shape": "box", "size_m": [0.1, 0.5], "at": [0.0, 0.0]}
    arena = {
        "obstacles": [fixed, *({**kind, "place": "random"} for kind in kinds)],
        "lights": [{**light, "place": "random"} for light in lights],
    }
    for seed in (1, 2, 3):
        static = built(one_group({"how": "arena"}, 1, **arena), seed).static
        obstacles, lit = static.obstacles[0], np.array([(o.x_m, o.y_m) for o in static.lights[0]])
        for i, first in enumerate(obstacles):
            assert depth(first, lit).min() >= 0.4 - 1e-9
            for second in obstacles[:i]:
                between = min(depth(first, rim(second, 200)).min(), depth(second, rim(first, 200)).min())
                assert between >= 0.25 - 1e-9
        for first in obstacles[-5:]:
            assert (abs(first.x_m + 1.0) <= 0.5, abs(first.y_m - 0.2) <= 1.5) == (True, True)
        apart = np.hypot(*(lit[:, None] - lit).transpose(2, 0, 1)) + 9.0 * np.eye(5)
        assert apart.min() >= 0.4
        assert np.all(np.abs(np.hypot(*(lit - RING["at"]).T) - 1.25) <= 0.25)


@pytest.mark.parametrize("placement", [{"how": "arena"}, {"how": "disc", "radius_m": 1.8}, BOX, RING])
def test_robots_have_the_heading_of_their_placement(placement: dict[str, Any]) -> None:
    turned, drawn = (built(one_group({**placement, **heading}), 1).pose for heading in ({"heading_rad": 4.0}, {}))
    assert np.allclose(turned[:, 2], 4.0 - 2.0 * np.pi)
    assert np.array_equal(turned[:, :2], drawn[:, :2])
    assert len(np.unique(drawn[:, 2])) == 12
    grid = built(one_group({"how": "grid", "spacing_m": 0.3, "heading_rad": -1.0}), 1).pose
    assert np.all(grid[:, 2] == -1.0)


def test_apart_m_holds_across_the_seam_of_a_torus() -> None:
    obstacles = [
        {"shape": "cylinder", "radius_m": 0.1, "at": [-1.85, 0.5]},
        {"shape": "box", "size_m": [0.2, 0.2], "count": 3, "place": "random", "apart_m": 0.3},
    ]
    arena = {"size_m": [4.0, 3.0], "boundary": "torus", "obstacles": obstacles}
    beyond = False
    for seed in range(1, 21):
        mapping = {**one_group({"how": "arena", "apart_m": 0.35}, 12, **arena), "physics": {"engine": "kinematic"}}
        world = built(mapping, seed)
        assert gaps(world, wrapped=True).min() >= 0.35 - 1e-12
        xy = world.pose[:, :2]
        assert np.all((xy >= [-2.0, -1.5]) & (xy < [2.0, 1.5]))
        beyond |= bool(np.any(np.abs(xy) > [2.0 - 0.035, 1.5 - 0.035]))
        for i, first in enumerate(world.static.obstacles[0]):
            assert np.all(np.abs(rim(first, 200)) <= [2.0, 1.5])
            for shift in [(4.0 * across, 3.0 * up) for across in (-1, 0, 1) for up in (-1, 0, 1)]:
                assert depth(first, xy + shift).min() >= 0.35 + 0.035 - 1e-12
                for second in world.static.obstacles[0][:i]:
                    assert depth(first, rim(second, 200) + shift).min() >= 0.3 - 1e-9
    assert beyond  # some stand across the seam


def test_disc_on_a_torus_continues_at_the_other_side() -> None:
    placement = {"how": "disc", "radius_m": 0.5, "at": [2.0, 1.5]}
    arena = {"size_m": [4.0, 3.0], "boundary": "torus"}
    world = built({**one_group(placement, 20, **arena), "physics": {"engine": "kinematic"}}, 1)
    x, y = world.pose[:, :2].T
    assert np.all(np.hypot(2.0 - np.abs(x), 1.5 - np.abs(y)) <= 0.5)
    assert {(bool(right), bool(up)) for right, up in zip(x > 0, y > 0, strict=True)} == {
        (right, up) for right in (False, True) for up in (False, True)
    }


def custom_body(folder: Path, **figures: Any) -> str:
    """A sheet of an e-puck with other figures."""
    path = folder / "own.toml"
    spec = {"like": "epuck", "name": "own", "source": "a test", **figures}
    path.write_text("".join(f"{key} = {json.dumps(value)}\n" for key, value in spec.items()))
    return str(path)


def test_torus_is_refused_for_robots_with_contacts(tmp_path: Path) -> None:
    mapping = one_group({"how": "arena"}, boundary="torus")
    with pytest.raises(BadInput, match=r"^file.toml: arena.boundary: expected walls or open: on a torus no robot"):
        built(mapping, 1)
    mapping["robots"]["flock"]["body"] = custom_body(tmp_path, contacts=False)
    assert built(mapping, 1).static.boundary == "torus"


def test_flying_robots_keep_clear_only_at_their_height(tmp_path: Path) -> None:
    spot = {"how": "poses", "poses": [[1.0, 0.0, 0.0]]}
    mapping = one_group(spot, 1, obstacles=[{"shape": "cylinder", "radius_m": 0.2, "at": [0.0, 0.0], "height_m": 0.4}])
    mapping["robots"]["high"] = {**mapping["robots"]["flock"], "body": custom_body(tmp_path, altitude_m=0.5)}
    assert np.array_equal(built(mapping, 1).pose[:, :2], [[1.0, 0.0]] * 2)
    over = copy.deepcopy(mapping)
    over["robots"]["high"]["place"] = {"how": "poses", "poses": [[0.1, 0.0, 0.0]]}
    assert np.array_equal(built(over, 1).pose[1, :2], [0.1, 0.0])
    over["arena"]["obstacles"][0]["height_m"] = 0.51
    with pytest.raises(BadInput, match=r"no room for high-0 with seed 1: at \(0.1, 0\)"):
        built(over, 1)
    mapping["robots"]["higher"] = copy.deepcopy(mapping["robots"]["high"])
    with pytest.raises(BadInput, match="no room for higher-0"):
        built(mapping, 1)


def test_ten_thousand_robots_find_room() -> None:
    mapping = changed("robots.flock", {"body": "footbot", "count": 10_000, "agent": "x", "place": {"how": "arena"}})
    mapping["arena"] = {"size_m": [50, 50]}
    xy = built(mapping, 1).pose[:, :2]
    assert cKDTree(xy[:10_000]).query(xy[:10_000], k=2)[0][:, 1].min() >= 2 * 0.085036758

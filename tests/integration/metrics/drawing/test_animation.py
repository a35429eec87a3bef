import re
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.observe.truth import Group
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.metrics.measures.metric import MetricInfo
from swarmwire.metrics.pictures.drawing.animation import FilmFigure, write_gif, write_mp4
from swarmwire.metrics.pictures.drawing.canvas import DEAD, OTHER_STATE, STATE_COLORS, robot_color, shade
from swarmwire.metrics.pictures.drawing.film import NO_STATE, Film
from swarmwire.metrics.pictures.drawing.scenario import _facts
from swarmwire.metrics.pictures.drawing.swarm import in_range
from tests.support.comms.lines import indexed, is_blocked_on_floor
from tests.support.metrics.films import LIGHT, OBSTACLES, film, two_groups
from tests.support.refusals import refused_input

pytest.importorskip("matplotlib", reason="needs the extra [report]")
SIZE_PX = 640
FLOOR, OBSTACLE, MOVABLE = (0xF4, 0xF6, 0xF9), (0xD3, 0xD8, 0xDF), (0xEA, 0xD9, 0xBD)
TICKS = range(0, 30, 2)
NEAR = 40  # a colour of a film is that of the picture within so much


def color_at(figure: FilmFigure, image: np.ndarray, x_m: float, y_m: float) -> tuple[int, ...]:
    """What the picture shows at a place of the arena."""
    column, up = figure._figure.axes[0].transData.transform((x_m, y_m))
    return tuple(int(value) for value in image[int(len(image) - up), int(column)][:3])


def shown(run: Film, index: int, *places_m) -> list[tuple[int, ...]]:
    figure = FilmFigure(run, SIZE_PX)
    image = figure.frame(index)
    return [color_at(figure, image, *place_m) for place_m in places_m]


def legend_of(run: Film) -> list[str]:
    return [text.get_text() for text in FilmFigure(run, SIZE_PX)._figure.legends[0].get_texts()]


def robots_shown(run: Film, index: int) -> list[tuple[int, ...]]:
    return shown(run, index, *run.pose[index, :, :2])


def test_frame_shows_only_its_own_tick():
    run = film(ticks=61)
    figure = FilmFigure(run, SIZE_PX)
    figure.frame(0)
    image = figure.frame(60)
    assert color_at(figure, image, *run.pose[0, 2, :2]) == FLOOR
    np.testing.assert_array_equal(image, FilmFigure(run, SIZE_PX).frame(60))


def test_dead_robots_are_grey_and_crossed_out_from_the_tick_in_which_they_die():
    alive = np.ones((31, 3), np.bool_)
    alive[15:, 1] = False
    run = film(alive=alive)
    assert robots_shown(run, 14)[1] == robot_color(0)
    first, cross, last = robots_shown(run, 15)
    assert (first, last) == (robot_color(0), robot_color(1))
    assert cross == tuple(round(255 * part) for part in shade(DEAD))


def test_states_colour_the_robots_that_are_in_them():
    state = np.full((31, 3), NO_STATE)
    state[:, 1], state[10:, 2] = 1, 0
    run = film(state=state, state_names=("search", "rest"))
    assert robots_shown(run, 0) == [OTHER_STATE, STATE_COLORS[1], OTHER_STATE]
    assert robots_shown(run, 10)[2] == STATE_COLORS[0]


def test_states_beyond_the_colours_share_one_and_the_frequent_have_their_own():
    names = tuple(f"s{i}" for i in range(len(STATE_COLORS) + 1))
    state = np.arange(31 * 3).reshape(31, 3) % len(names)
    state[-1] = [0, 3, 4]
    state[state == 3] = 4
    state[-1, 1] = 3  # the rarest: seen once
    run = film(state=state, state_names=names)
    assert robots_shown(run, 30) == [STATE_COLORS[0], OTHER_STATE, STATE_COLORS[3]]


def test_obstacles_and_lights_are_drawn_and_movable_ones_look_otherwise_and_are_in_the_legend():
    pillar, box, _ = OBSTACLES
    colors = shown(film(), 0, *((shape.x_m, shape.y_m) for shape in (*OBSTACLES, LIGHT)), (2.5, 0.5))
    assert colors == [OBSTACLE, OBSTACLE, OBSTACLE, (0xFF, 0xD2, 0x3F), FLOOR]
    static = replace(two_groups(), obstacles=((pillar, replace(box, mass_kg=0.2)),))
    movable = np.broadcast_to([box.x_m, box.y_m, box.heading_rad], (31, 1, 3))
    run = film(static=static, movable=movable)
    assert shown(run, 0, (pillar.x_m, pillar.y_m), (box.x_m, box.y_m)) == [OBSTACLE, MOVABLE]
    assert "movable" in legend_of(run)
    assert "movable" not in legend_of(film())
    assert {"1 cylinder", "1 movable box"} <= {text for _, text in _facts(static, 1.0, 1.0)}


@pytest.mark.parametrize(
    ("endpoints", "joined"),
    [
        ({}, True),
        ({"alive": np.tile([False, True, True], (31, 1))}, False),
        ({"static": replace(two_groups(), range_m=1.4)}, False),
        ({"static": replace(two_groups(), range_m=None)}, False),
        ({"static": replace(two_groups(), obstacles=((Obstacle("cylinder", -2.6, -1.0, radius_m=0.1),),))}, False),
    ],
)
def test_links_join_robots_alive_in_range_and_sight(endpoints, joined):
    pixel_m = 0.02
    across = [(-2.25, -1.0 + up * pixel_m) for up in (-1, 0, 1)]  # half way between two robots
    assert (shown(film(**endpoints), 0, *across) != [FLOOR] * 3) == joined


def test_trail_follows_a_robot_that_moved_and_fades():
    run = film(ticks=101)
    pose = run.pose[100, 0]
    near, far, beyond = shown(run, 100, *((pose[0] - behind, pose[1]) for behind in (0.4, 2.0, 3.0)))
    assert sum(near) < sum(far) < sum(FLOOR)
    assert beyond == FLOOR  # more than five seconds ago


def flying(altitude_m: float) -> Film:
    """A film in which the first robot, of a group of its own, hovers at this height below one of another group."""
    body = replace(load_body("footbot"), radius_m=0.4)
    groups = (Group("air", replace(body, altitude_m=altitude_m), 0, 1), Group("floor", body, 1, 3))
    static = replace(two_groups(), groups=groups, robot_names=("air-0", "floor-0", "floor-1"))
    run = film(static=static)
    run.pose[:, 1, :2] = run.pose[:, 0, :2] + (0.15, 0.15)
    return run


def test_robots_that_fly_lie_above_those_on_the_floor_with_a_shadow_and_their_altitude():
    beneath = (-2.7, -1.375)  # just outside the disc
    assert [robots_shown(flying(altitude_m), 0)[0] for altitude_m in (1.0, 0.0)] == [robot_color(0), robot_color(1)]
    (shadow,), (floor,) = shown(flying(1.0), 0, beneath), shown(flying(0.0), 0, beneath)
    assert sum(shadow) < sum(floor) - 60
    assert floor == FLOOR
    assert "1 m" in legend_of(flying(1.0))[0]


@pytest.mark.parametrize("index", [0, 30])
def test_picture_that_is_saved_shows_what_the_frame_does(tmp_path, index):
    from PIL import Image

    figure = FilmFigure(film(), SIZE_PX)
    frame = figure.frame(index).copy()
    figure.save(index, tmp_path / "a.png")
    saved = np.asarray(Image.open(tmp_path / "a.png").convert("RGB"))
    assert max(saved.shape) == SIZE_PX
    np.testing.assert_array_equal(saved, frame)


def test_frame_has_even_sides_at_any_size():
    for size_px in (101, 333, 480):
        height, width, _ = FilmFigure(film(), size_px).frame(0).shape
        assert height % 2 == width % 2 == 0
        assert abs(max(height, width) - size_px) <= 1


def test_metrics_without_values_are_plotted_only_if_listed():
    assert len(FilmFigure(film(), 300)._figure.axes) == 2
    assert len(FilmFigure(film(), 300, ["order", "min_gap"])._figure.axes) == 3
    assert len(FilmFigure(film(metrics={}), 300)._figure.axes) == 1


def test_metrics_of_the_scenario_are_plotted_before_the_usual_ones():
    names = ["order", "min_gap", "link_pdr", "coverage", "spread"]
    run = film(metrics=dict.fromkeys(names, np.linspace(0.0, 1.0, 31)))
    facts = {
        name: MetricInfo(name, "", "", "level", (None, None)) for name in ("order", "min_gap", "coverage", "spread")
    }
    axes = FilmFigure(replace(run, facts=facts), 300)._figure.axes[1:]
    assert [plot.get_title(loc="left") for plot in axes] == ["coverage", "spread", "order"]


def test_custom_metric_is_plotted_by_its_numbers_alone():
    axes = FilmFigure(film(metrics={"my_share": np.linspace(0.2, 0.5, 31)}), 300, ["my_share"])._figure.axes[1]
    low, high = axes.get_ylim()
    assert axes.get_title(loc="left") == "my share"
    assert low <= 0.0
    assert 0.5 < high < 0.6


@pytest.mark.parametrize(
    ("size", "metrics", "where", "key"),
    [(10, None, "--size", ""), (300, ["ordr"], "--metric", "ordr"), (300, ["order"] * 5, "--metric", "")],
)
def test_film_options_that_cannot_be_drawn_are_refused(size, metrics, where, key):
    with refused_input(where, key):
        FilmFigure(film(), size, metrics)


@pytest.mark.parametrize("name", ["a.jpg", "absent/a.png", "."])
def test_path_that_cannot_be_written_is_refused_for_a_picture(tmp_path, name):
    with refused_input(tmp_path / name):
        FilmFigure(film(), 300).save(0, tmp_path / name)
    assert not any(tmp_path.iterdir())


def test_pairs_are_of_those_alive_that_are_near_enough():
    position_m = np.array([[0.0, 0.0], [1.0, 0.0], [2.5, 0.0], [0.0, 1.0]])
    alive = np.array([True, True, True, False])
    assert in_range(position_m, alive, 1.5, ()).tolist() == [[0, 1], [1, 2]]
    assert in_range(position_m, alive, 1.4, ()).tolist() == [[0, 1]]
    assert in_range(position_m, ~alive, 9.0, ()).tolist() == []
    assert in_range(position_m, np.zeros(4, np.bool_), 9.0, ()).tolist() == []


@pytest.mark.parametrize("obstacle", OBSTACLES, ids=lambda obstacle: obstacle.shape)
def test_obstacles_are_in_the_way_as_they_are_in_the_air(obstacle: Obstacle):
    centre = np.array([obstacle.x_m, obstacle.y_m])
    position_m = centre + np.random.default_rng(4).uniform(-1.0, 1.0, (60, 2))
    index = indexed(((obstacle,),), (8.0, 8.0))
    expected = {
        (i, j)
        for i in range(60)
        for j in range(i + 1, 60)
        if not is_blocked_on_floor(index, 0, *position_m[i], *position_m[j])
    }
    within_range = in_range(position_m, np.ones(60, np.bool_), 9.0, (obstacle,))
    assert {(min(pair), max(pair)) for pair in within_range.tolist()} == expected
    assert 0 < len(expected) < 60 * 59 / 2


@pytest.fixture(scope="module")
def figure():
    return FilmFigure(film(), 320)


def off(shown, color):
    return np.abs(shown.astype(int) - color).max()


def robot_at(figure, tick):
    """Row and column of the middle of the foot-bot."""
    x, up = figure._figure.axes[0].transData.transform(film().pose[tick, 2, :2])
    return int(figure.frame(tick).shape[0] - up), int(x)


def test_gif_has_a_frame_per_tick_in_the_colours_of_the_picture(figure, tmp_path):
    from PIL import Image

    write_gif(tmp_path / "a.gif", (figure.frame(i) for i in TICKS), [figure.frame(0).copy()], 12.5)
    with Image.open(tmp_path / "a.gif") as gif:
        assert gif.n_frames == len(TICKS)
        assert gif.info["loop"] == 0
        for index, tick in enumerate(TICKS):
            gif.seek(index)
            assert gif.info["duration"] == 80
            shown = np.asarray(gif.convert("RGB"))
            assert off(shown[robot_at(figure, tick)], robot_color(1)) < NEAR
            assert tuple(shown[1, 1]) == (255, 255, 255)


def test_frames_that_do_not_differ_prolong_the_one_before(figure, tmp_path):
    from PIL import Image

    write_gif(tmp_path / "a.gif", (figure.frame(i) for i in (0, 0, 5)), [figure.frame(0).copy()], 10.0)
    with Image.open(tmp_path / "a.gif") as gif:
        assert gif.n_frames == 2
        assert gif.info["duration"] == 200


def test_mp4_decodes_to_a_frame_per_tick_in_the_colours_of_the_picture(figure, tmp_path):
    import imageio_ffmpeg

    write_mp4(tmp_path / "a.mp4", (figure.frame(i) for i in TICKS), 5.0)
    decode = ["-i", tmp_path / "a.mp4", "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    decoded = subprocess.run([imageio_ffmpeg.get_ffmpeg_exe(), *decode], capture_output=True, check=True, timeout=60)
    assert re.search(rb"Video: h264.* yuv420p.* 5 fps", decoded.stderr)
    frames = np.frombuffer(decoded.stdout, np.uint8).reshape(-1, *figure.frame(0).shape)
    assert len(frames) == len(TICKS)
    for shown, tick in zip(frames, TICKS, strict=True):
        assert off(shown[robot_at(figure, tick)], robot_color(1)) < NEAR


def test_twenty_robots_for_a_minute_make_a_small_gif(tmp_path):
    """The size that READMEs bear: below 10 kB a frame, with links and trails that all move."""
    ticks, robots = 60, 20
    group = Group("flock", load_body("epuck"), 0, robots)
    static = replace(two_groups(), groups=(group,), robot_names=tuple(map(str, range(robots))))
    rng = np.random.default_rng(3)
    heading = rng.uniform(-3, 3, robots) + np.cumsum(rng.normal(0, 0.1, (ticks, robots)), axis=0)
    step = 0.05 * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    position_m = rng.uniform(-2, 2, (robots, 2)) + np.cumsum(step, axis=0)
    pose = np.concatenate([position_m, heading[:, :, None]], axis=-1)
    alive, time_s = np.ones((ticks, robots), np.bool_), np.arange(ticks) / 10
    metrics = {"order": rng.uniform(size=ticks), "link_pdr": rng.uniform(size=ticks)}
    figure = FilmFigure(film(static=static, pose=pose, alive=alive, time_s=time_s, metrics=metrics), 480)
    samples = [figure.frame(i).copy() for i in range(0, ticks, 10)]
    write_gif(tmp_path / "a.gif", (figure.frame(i) for i in range(ticks)), samples, 10.0)
    assert (tmp_path / "a.gif").stat().st_size < 10_000 * ticks

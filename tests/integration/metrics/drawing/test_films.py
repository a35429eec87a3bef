"""Films are read back: how many frames there are, how long they last, and what they show."""

import re
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.truth import Group
from swarmwire.metrics.drawing.animation import FilmFigure, write_gif, write_mp4
from swarmwire.metrics.drawing.canvas import robot_color
from tests.support.metrics.films import film, two_groups

pytest.importorskip("matplotlib", reason="needs the extra [report]")
TICKS = range(0, 30, 2)
NEAR = 40  # a colour of a film is that of the picture within so much


@pytest.fixture(scope="module")
def figure():
    return FilmFigure(film(), 320)


def off(shown, color):
    return np.abs(shown.astype(int) - color).max()


def robot_at(figure, tick):
    """Row and column of the middle of the foot-bot."""
    x, up = figure._figure.axes[0].transData.transform(film().pose[tick, 2, :2])
    return int(figure.frame(tick).shape[0] - up), int(x)


def test_a_gif_has_a_frame_per_tick_in_the_colours_of_the_picture(figure, tmp_path):
    from PIL import Image

    write_gif(tmp_path / "a.gif", (figure.frame(i) for i in TICKS), [figure.frame(0).copy()], 12.5)
    with Image.open(tmp_path / "a.gif") as gif:
        assert gif.n_frames == len(TICKS)
        assert gif.info["loop"] == 0
        for place, tick in enumerate(TICKS):
            gif.seek(place)
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


def test_an_mp4_decodes_to_a_frame_per_tick_in_the_colours_of_the_picture(figure, tmp_path):
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
    place = rng.uniform(-2, 2, (robots, 2)) + np.cumsum(step, axis=0)
    pose = np.concatenate([place, heading[:, :, None]], axis=-1)
    alive, time_s = np.ones((ticks, robots), np.bool_), np.arange(ticks) / 10
    metrics = {"order": rng.uniform(size=ticks), "link_pdr": rng.uniform(size=ticks)}
    figure = FilmFigure(film(static=static, pose=pose, alive=alive, time_s=time_s, metrics=metrics), 480)
    samples = [figure.frame(i).copy() for i in range(0, ticks, 10)]
    write_gif(tmp_path / "a.gif", (figure.frame(i) for i in range(ticks)), samples, 10.0)
    assert (tmp_path / "a.gif").stat().st_size < 10_000 * ticks

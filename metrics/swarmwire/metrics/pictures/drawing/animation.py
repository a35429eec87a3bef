"""Frames of a run (the arena with trails, and metrics beside it), and films of them as GIF and MP4."""

import errno
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from itertools import chain
from pathlib import Path
from subprocess import DEVNULL, PIPE, Popen
from tempfile import TemporaryFile
from typing import IO, Any, cast

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, ByteArray, IntArray
from swarmwire.comms.base.extras import FILM, REPORT
from swarmwire.metrics.measures.torus import unwrap_path
from swarmwire.metrics.pictures.drawing.canvas import (
    INK,
    LONG_SIDE_IN,
    STATE_COLORS,
    TITLE_PT,
    add_arena_axes,
    lay_out,
    new_figure,
    pixels,
    save,
)
from swarmwire.metrics.pictures.drawing.film import NO_STATE, Film
from swarmwire.metrics.pictures.drawing.metrics_strip import MetricStrip, choose
from swarmwire.metrics.pictures.drawing.packets import PacketEnds, PacketLines, packet_entries
from swarmwire.metrics.pictures.drawing.scene import (
    add_legend,
    columns_in,
    dead_entry,
    draw_scale_bar,
    draw_scenery,
    group_entries,
    link_entry,
    movable_entry,
    place_movable,
    state_entries,
)
from swarmwire.metrics.pictures.drawing.swarm import SwarmArtist, in_range

TRAIL_S = 5.0
MAX_TRAIL_POINTS = 64
_STRIP_IN = 1.15  # height of the metrics below the arena
_LEGEND_WIDTH_IN = LONG_SIDE_IN - 0.3
COLORS = 64
EVEN_COLORS = 24  # colours of even areas, part of COLORS
_MIN_COLOR_DISTANCE = 6  # steps of a channel
_MS_STEP = 10  # resolution of time in a GIF
_QUALITY = "20"  # x264's constant rate factor: lower is better, 18 is considered visually lossless


class FilmFigure:
    """A figure that draws any tick of a film. Fixed parts are drawn once and kept as pixels."""

    def __init__(
        self,
        film: Film,
        size_px: int,
        metrics: Sequence[str] | None = None,
        trail_s: float = TRAIL_S,
        packets: PacketEnds | None = None,
        speed: float | None = None,
    ) -> None:
        """Create a figure whose longer side has this many pixels, with these metrics (None: default).

        A trail shows the path of each robot over the last `trail_s`. With `packets`, lines are packets that ended since
        the previous tick; without, they join robots in range and sight. `speed`, in simulated seconds per second of a
        film, is written next to the time. BadInput for a metric that was not recorded, or a size out of bounds.
        """
        self._film, static, self._trail_s, self._packets = film, film.static, trail_s, packets
        names = choose(film.metrics, film.facts, metrics)
        entries = _entries(film, packets)
        columns = columns_in(entries, _LEGEND_WIDTH_IN)
        layout = lay_out(static.arena_size_m, _STRIP_IN if names else 0.0, -(-len(entries) // columns), axes_in=0.0)
        self._figure = figure = new_figure(layout.width_in, layout.height_in, size_px)
        axes = add_arena_axes(figure, layout, static.arena_size_m)
        self._movable = draw_scenery(axes, static, film.arena)
        self._swarm = SwarmArtist(axes, static)
        self._lines = PacketLines(axes, static)
        self._state = _colored(film)
        self._speed = "" if speed is None else f" at {speed:g} x"
        draw_scale_bar(axes, static.arena_size_m, self._swarm.enlargement)
        title = f"{static.name}, seed {static.seeds[film.arena]}" if static.arenas > 1 else static.name
        top = layout.below_top(0.22)
        figure.text(layout.left, top, title, fontsize=TITLE_PT, fontweight="bold", color=INK)
        self._time: Any = figure.text(layout.right, top, "", fontsize=TITLE_PT, color=INK, ha="right")
        add_legend(figure, entries, layout.left, layout.below_top(0.34), columns)
        self._strip = MetricStrip(figure, layout, film, names) if names else None
        pushed = [self._movable] if static.movable else []
        self._moving = [
            *pushed,
            *self._lines.artists,
            *self._swarm.artists,
            self._time,
            *(self._strip.artists if self._strip else ()),
        ]
        self._background: Any = None  # pixels of the fixed parts

    def frame(self, index: int) -> ByteArray:
        """Return the pixels of a tick, (height, width, 3); a view that the next frame overwrites."""
        canvas = self._figure.canvas
        if self._background is None:
            self._animate(True)
            canvas.draw()
            self._background = canvas.copy_from_bbox(self._figure.bbox)
        self._show(index)
        canvas.restore_region(self._background)
        for artist in self._moving:
            self._figure.draw_artist(artist)
        return pixels(self._figure)

    def save(self, index: int, to: Path) -> None:
        """Write the picture of a tick as PNG, SVG or PDF; BadInput for another suffix or a missing folder."""
        self._animate(False)
        self._show(index)
        save(self._figure, to)

    def _animate(self, animated: bool) -> None:
        """Draw the moving artists separately from the fixed parts, or together with them."""
        for artist in self._moving:
            artist.set_animated(animated)

    def _show(self, index: int) -> None:
        film = self._film
        pose, alive = film.pose[index], film.alive[index]
        movable = film.movable_at(index)
        if movable:
            place_movable(self._movable, movable)
        edges: IntArray | None = None
        static = film.static
        if self._packets is not None:
            self._lines.show(pose[:, :2], *self._packets.ended_in(index))
        elif static.range_m is not None:
            torus_m = static.arena_size_m if static.boundary == "torus" else None
            edges = in_range(pose[:, :2], alive, static.range_m, (*static.fixed(film.arena), *movable), torus_m)
        state = None if self._state is None else self._state[index]
        self._swarm.show(pose, alive, edges, _trail(film, index, self._trail_s), state)
        self._time.set_text(f"t = {film.time_s[index]:.1f} s{self._speed}")
        if self._strip:
            self._strip.show(index)


def _trail(film: Film, index: int, trail_s: float) -> AnyArray:
    """Return the positions of the robots in the last seconds, (points, n, 2), at every k-th tick if there are many."""
    first = film.index_at(float(film.time_s[index]) - trail_s)
    max_points = round(MAX_TRAIL_POINTS * max(1.0, trail_s / TRAIL_S))
    step = max(1, (index - first) // max_points)
    return unwrap_path(film.pose[np.arange(index, first - 1, -step)[::-1], :, :2], film.static)


def _colored(film: Film) -> IntArray | None:
    """Return the states as indices of colours, which the most frequent states have."""
    if film.state is None:
        return None
    color_of_name = {name: i for i, name in enumerate(_frequent(film))}
    color = [color_of_name.get(name, NO_STATE) for name in film.state_names]
    return np.array([*color, NO_STATE])[film.state]  # NO_STATE is -1, the last index


def _frequent(film: Film) -> tuple[str, ...]:
    """Return the states with a colour: all, or the most frequent ones, by first tick."""
    assert film.state is not None
    counts = np.bincount(film.state[film.state >= 0], minlength=len(film.state_names))
    frequent: list[int] = sorted(np.argsort(-counts, kind="stable")[: len(STATE_COLORS)].tolist())
    return tuple(film.state_names[i] for i in frequent)


def _entries(film: Film, packets: PacketEnds | None) -> list[Any]:
    static = film.static
    entries = group_entries(static, filled=film.state is None)
    if film.state is not None:
        names = _frequent(film)
        stateless = len(names) < len(film.state_names) or bool((film.state == NO_STATE).any())
        entries += state_entries(names, others=stateless)
    if not film.alive.all():
        entries.append(dead_entry())
    if static.movable:
        entries.append(movable_entry())
    if packets is not None:
        entries += packet_entries(packets.fates)
    elif static.range_m is not None:
        entries.append(link_entry(static.range_m))
    return entries


def write_gif(to: Path, frames: Iterable[ByteArray], samples: Sequence[ByteArray], frames_per_s: float) -> None:
    """Write frames (height, width, 3) as a film that repeats forever, with the colours of the samples.

    Equal consecutive frames are merged. BadInput without the extra [report].
    """
    REPORT.need("films")
    palette = _palette(samples)
    images = _indexed(frames, palette)
    first = next(images)
    duration_ms = max(2 * _MS_STEP, _MS_STEP * round(1000.0 / frames_per_s / _MS_STEP))
    first.save(to, "GIF", save_all=True, append_images=images, duration=duration_ms, loop=0, disposal=1, optimize=True)


def _palette(samples: Sequence[ByteArray]) -> Any:
    """Return the exact colours of even areas, which are the most frequent, and mean colours of their edges."""
    from PIL import Image

    parts = np.concatenate([sample.reshape(-1, 3) for sample in samples]).astype(np.int64)
    packed, counts = np.unique(parts @ (1 << 16, 1 << 8, 1), return_counts=True)
    frequent = packed[np.argsort(-counts, kind="stable")]
    color = np.stack([frequent >> 16, frequent >> 8 & 255, frequent & 255], axis=1)
    means = Image.fromarray(color[None].astype(np.uint8)).quantize(COLORS - EVEN_COLORS).getpalette() or []
    chosen = _with_distinct(np.empty((0, 3), np.int64), color, EVEN_COLORS)
    chosen = _with_distinct(chosen, np.array(means, np.int64).reshape(-1, 3), COLORS)
    palette = Image.new("P", (1, 1))
    palette.putpalette(chosen.ravel().tolist())
    return palette


def _with_distinct(chosen: IntArray, candidates: IntArray, limit: int) -> IntArray:
    """Return the chosen colours with further candidates that are not close to them, at most `limit`.

    Pillow matches colours to within four steps, so it would confuse close colours.
    """
    for candidate in candidates:
        if len(chosen) == limit:
            break
        if not len(chosen) or np.abs(chosen - candidate).max(axis=1).min() > _MIN_COLOR_DISTANCE:
            chosen = np.concatenate([chosen, candidate[None]])
    return chosen


def _indexed(frames: Iterable[ByteArray], palette: Any) -> Iterator[Any]:
    from PIL import Image

    for frame in frames:
        # Without dithering, fixed parts are equal from frame to frame and take no bytes.
        yield Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE)


def write_mp4(to: Path, frames: Iterable[ByteArray], frames_per_s: float) -> None:
    """Write frames (height, width, 3), with even sides, as a film.

    BadInput without the extra [film]. OSError if ffmpeg fails, for example on a full disk.
    """
    FILM.need("films as .mp4")
    from imageio_ffmpeg import get_ffmpeg_exe  # its own writer does not report failures of ffmpeg

    frames = iter(frames)
    first = next(frames)
    height, width = first.shape[:2]
    source = f"-f rawvideo -pix_fmt rgb24 -s {width}x{height} -r {frames_per_s:.6g} -i -"
    film = f"-c:v libx264 -pix_fmt yuv420p -crf {_QUALITY} -movflags +faststart -f mp4"
    command = [get_ffmpeg_exe(), "-v", "error", "-y", *source.split(), *film.split(), str(to)]
    with TemporaryFile() as errors, Popen(command, stdin=PIPE, stdout=DEVNULL, stderr=errors) as ffmpeg:
        with suppress(BrokenPipeError):  # ffmpeg has ended, with an exit code
            for frame in chain([first], frames):
                cast("IO[bytes]", ffmpeg.stdin).write(np.ascontiguousarray(frame).data)
        ffmpeg.communicate()
        if ffmpeg.returncode:
            errors.seek(0)
            is_full = os.strerror(errno.ENOSPC).encode() in errors.read()
            number = errno.ENOSPC if is_full else errno.EIO
            raise OSError(number, os.strerror(number), str(to))

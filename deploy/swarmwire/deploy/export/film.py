"""Films of a run: the arena and its metrics, as GIF or MP4."""

from functools import partial
from pathlib import Path
from typing import Literal

from rich.progress import track

from swarmwire.deploy.export.exporter import Exporter, ExportOptions

DEFAULT_FRAMES_PER_S = {"gif": 10.0, "mp4": 25.0}
DEFAULT_SIZE_PX = {"gif": 480, "mp4": 960}
PALETTE_SAMPLES = 8


def _write(kind: Literal["gif", "mp4"], run: Path, to: Path, options: ExportOptions) -> str:
    from swarmwire.metrics.atomic import check_output_path, output_file
    from swarmwire.metrics.drawing.animation import FilmFigure, write_gif, write_mp4
    from swarmwire.metrics.drawing.film import film_of, footage
    from swarmwire.metrics.run_folder.reader import RunFolder

    film = film_of(RunFolder(run), options.arena or 0, str(run))
    check_output_path(to, (f".{kind}",))
    figure = FilmFigure(film, DEFAULT_SIZE_PX[kind] if options.size_px is None else options.size_px, options.metrics)
    times = options.from_s, options.until_s, options.frames_per_s, options.speed
    shown = footage(film.time_s, film.static.rate_hz, *times, DEFAULT_FRAMES_PER_S[kind])
    console = options.console
    console.print(f"{len(shown.ticks)} frames, {shown.frames_per_s:g} a second, {shown.speed:g} x real time")
    ticks = track(shown.ticks, "drawing", console=console, transient=True, disable=not console.is_terminal)
    frames = (figure.frame(int(tick)) for tick in ticks)
    with output_file(to) as part:
        if kind == "mp4":
            write_mp4(part, frames, shown.frames_per_s)
        else:
            some = shown.ticks[:: max(1, len(shown.ticks) // PALETTE_SAMPLES)]
            write_gif(part, frames, [figure.frame(int(tick)).copy() for tick in some], shown.frames_per_s)
    return ""


_OPTIONS = frozenset({"from_s", "until_s", "frames_per_s", "speed", "arena", "metrics", "size_px"})
GIF = Exporter("film", (".gif",), _OPTIONS, partial(_write, "gif"))
MP4 = Exporter("film", (".mp4",), _OPTIONS, partial(_write, "mp4"))

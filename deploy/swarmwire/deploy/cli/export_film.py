"""`swarmwire export --gif` and `--mp4`: a run as a film."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from rich.console import Console
from rich.progress import track

if TYPE_CHECKING:
    from swarmwire.metrics.drawing.animation import FilmFigure
    from swarmwire.metrics.drawing.film import Footage

FilmKind = Literal["gif", "mp4"]
USUAL_FRAMES_PER_S = {"gif": 10.0, "mp4": 25.0}
PALETTE_SAMPLES = 8


@dataclass(frozen=True)
class Cut:
    """Which part of a run a film shows, and how fast; what is None is as usual."""

    from_s: float | None
    until_s: float | None
    frames_per_s: float | None
    speed: float | None  # simulated seconds per second


def export_film(
    kind: FilmKind,
    run: Path,
    to: Path,
    arena: int,
    cut: Cut,
    size_px: int,
    metrics: list[str] | None,
    console: Console,
) -> None:
    """Draw the arena, and metrics beside it, as a film; the console is told how it goes."""
    from swarmwire.metrics.atomic import check_output_path
    from swarmwire.metrics.drawing.animation import FilmFigure
    from swarmwire.metrics.drawing.film import film_of, footage
    from swarmwire.metrics.run_folder.reader import RunFolder

    film = film_of(RunFolder(run), arena, str(run))
    check_output_path(to, (f".{kind}",))
    figure = FilmFigure(film, size_px, metrics)
    times = cut.from_s, cut.until_s, cut.frames_per_s, cut.speed
    shown = footage(film.time_s, film.static.rate_hz, *times, USUAL_FRAMES_PER_S[kind])
    _write(figure, shown, kind, to, console)


def _write(figure: "FilmFigure", shown: "Footage", kind: FilmKind, to: Path, console: Console) -> None:
    from swarmwire.metrics.atomic import output_file
    from swarmwire.metrics.drawing.animation import write_gif, write_mp4

    count = len(shown.ticks)
    console.print(f"{count} frames, {shown.frames_per_s:g} a second, {shown.speed:g} x real time")
    ticks = track(shown.ticks, "drawing", console=console, transient=True, disable=not console.is_terminal)
    frames = (figure.frame(int(tick)) for tick in ticks)
    with output_file(to) as part:
        if kind == "mp4":
            write_mp4(part, frames, shown.frames_per_s)
        else:
            some = shown.ticks[:: max(1, count // PALETTE_SAMPLES)]
            write_gif(part, frames, [figure.frame(int(tick)).copy() for tick in some], shown.frames_per_s)

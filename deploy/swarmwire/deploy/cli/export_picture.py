"""`swarmwire export --png` and `--pdr`: pictures of a run."""

from pathlib import Path
from typing import TYPE_CHECKING

from swarmwire.comms.errors import BadInput

if TYPE_CHECKING:
    from swarmwire.metrics.drawing.film import Film

END = "end"


def export_picture(run: Path, to: Path, arena: int, at: str, size_px: int, metrics: list[str] | None) -> None:
    """Draw the arena, and metrics beside it, `at` a time in s or END; BadInput if it was not recorded."""
    from swarmwire.metrics.drawing.animation import FilmFigure
    from swarmwire.metrics.drawing.canvas import check_picture
    from swarmwire.metrics.drawing.film import film_of
    from swarmwire.metrics.run_folder.reader import RunFolder

    film = film_of(RunFolder(run), arena, str(run))
    check_picture(to)
    figure = FilmFigure(film, size_px, metrics)
    figure.save(film.index_at(_time_s(at, film)), to)


def export_distances(run: Path, to: Path, arena: int, size_px: int) -> None:
    """Draw the share of receivers that received, over distance."""
    from swarmwire.metrics.drawing.radio import draw_distances
    from swarmwire.metrics.run_folder.reader import RunFolder

    draw_distances(RunFolder(run), arena, to, size_px)


def is_time(text: str) -> bool:
    """Whether it names a moment: a number, or END."""
    if text == END:
        return True
    try:
        float(text)
    except ValueError:
        return False
    return True


def _time_s(text: str, film: "Film") -> float:
    """The moment asked for, in s; BadInput if it is none of the recorded ones."""
    first, last = float(film.time_s[0]), float(film.time_s[-1])
    if text == END:
        return last
    if not is_time(text) or not first <= float(text) <= last + 1.0 / film.static.rate_hz:
        raise BadInput("--png", "", f"expected a time that was recorded, {first:g} to {last:g} s, or {END}; got {text}")
    return float(text)

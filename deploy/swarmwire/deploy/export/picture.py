"""Pictures of a run: the arena at one moment, delivery over distance, or the recording as rerun's viewer shows it."""

from pathlib import Path
from typing import TYPE_CHECKING

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.export.exporter import Exporter, ExportOptions

if TYPE_CHECKING:
    from swarmwire.metrics.drawing.film import Film

DEFAULT_SIZE_PX = 1280
SUFFIXES = (".png", ".svg", ".pdf")


def _write_arena(run: Path, to: Path, options: ExportOptions) -> str:
    from swarmwire.metrics.drawing.animation import FilmFigure
    from swarmwire.metrics.drawing.canvas import check_picture
    from swarmwire.metrics.drawing.film import film_of
    from swarmwire.metrics.run_folder.reader import RunFolder

    film = film_of(RunFolder(run), options.arena or 0, str(run))
    check_picture(to)
    figure = FilmFigure(film, DEFAULT_SIZE_PX if options.size_px is None else options.size_px, options.metrics)
    figure.save(film.index_at(_time_s(options.at_s, film)), to)
    return ""


def _time_s(at_s: float | None, film: "Film") -> float:
    """The time of the picture; BadInput if it was not recorded."""
    first, last = float(film.time_s[0]), float(film.time_s[-1])
    if at_s is None:
        return last
    if not first <= at_s <= last + 1.0 / film.static.rate_hz:
        raise BadInput("--at", "", f"expected a time that was recorded, {first:g} to {last:g} s; got {at_s:g}")
    return at_s


def _write_delivery(run: Path, to: Path, options: ExportOptions) -> str:
    from swarmwire.metrics.drawing.radio import draw_distances
    from swarmwire.metrics.run_folder.reader import RunFolder

    size_px = DEFAULT_SIZE_PX if options.size_px is None else options.size_px
    draw_distances(RunFolder(run), options.arena or 0, to, size_px)
    return ""


def _write_viewer(run: Path, to: Path, options: ExportOptions) -> str:
    from swarmwire.metrics.run_folder.layout import RECORDING
    from swarmwire.metrics.viewer.screenshot import render_png

    render_png(run / RECORDING if run.is_dir() else run, to, options.at_s)
    return ""


ARENA = Exporter("arena", SUFFIXES, frozenset({"at_s", "arena", "metrics", "size_px"}), _write_arena)
DELIVERY = Exporter("delivery", SUFFIXES, frozenset({"arena", "size_px"}), _write_delivery)
VIEWER = Exporter("viewer", (".png",), frozenset({"at_s"}), _write_viewer)

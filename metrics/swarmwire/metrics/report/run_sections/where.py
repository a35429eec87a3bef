"""Where the robots went."""

from swarmwire.metrics.report.in_words import counted, number
from swarmwire.metrics.report.run_data import ARENA, RunData
from swarmwire.metrics.report.run_figures.paths import Paths, paths_of
from swarmwire.metrics.report.run_figures.trajectories import trajectories
from swarmwire.metrics.report.section import Figure
from swarmwire.metrics.report.svg import as_svg


def where(run: RunData) -> list[Figure]:
    """The figure, if there is a tick."""
    if isinstance(run.film, str):
        return []
    film, static = run.film, run.static
    paths = paths_of(film.pose[:, :, :2], static)
    movable = None if film.movable is None else film.movable[-1]
    end_s = float(film.time_s[-1])
    figure = trajectories(static, ARENA, paths, film.pose[-1], film.alive[-1], movable, end_s)
    colored = "by group" if len(static.groups) > 1 else "by time, from light to dark"
    caption = (
        f"Ways of the robots, coloured {colored}; small circles are starts, discs where they were at {number(end_s)} s."
    )
    left_out = _left_out(paths, len(film.time_s), static.robots)
    return [Figure("trajectories", as_svg(figure, "trajectories"), caption + left_out)]


def _left_out(paths: Paths, ticks: int, robots: int) -> str:
    said = ""
    if len(paths.robots) < robots:
        said += f" The ways of {len(paths.robots):,} of {counted(robots, 'robot')} are drawn."
    if len(paths.ticks) < ticks:
        said += f" Of {ticks:,} ticks {len(paths.ticks):,} are drawn, evenly spread."
    return said

"""The delivery ratio over distance as a picture, and below it over how many receivers it was taken."""

from pathlib import Path

from swarmwire.comms.errors import BadInput
from swarmwire.metrics.drawing.canvas import new_figure, save
from swarmwire.metrics.drawing.delivery_over_distance import draw_intended, draw_ratio, received_bins
from swarmwire.metrics.drawing.looks import INK, LONG_SIDE_IN, TITLE_PT
from swarmwire.metrics.drawing.plain_axes import plain_axes
from swarmwire.metrics.run_folder import RunFolder
from swarmwire.metrics.verify.sound_table import sound_table

_HEIGHT_IN = 3.9


def draw_distances(run: RunFolder, arena: int, to: Path, size_px: int) -> None:
    """Write the picture of one arena. BadInput for a path, size or arena that cannot be, or a run without the table."""
    static = run.static
    if not 0 <= arena < static.arenas:
        raise BadInput("--arena", "", f"expected 0 to {static.arenas - 1}, got {arena}")
    table = received_bins(sound_table(run, "radio_distances", run.radio_distances(arena)))
    if not len(table):
        raise BadInput("--pdr", "", "expected a run in which packets went on air")
    figure = new_figure(LONG_SIDE_IN, _HEIGHT_IN, size_px)
    title = static.name if static.arenas == 1 else f"{static.name}, seed {static.seeds[arena]}"
    figure.text(0.025, 0.945, title, fontsize=TITLE_PT, fontweight="bold", color=INK)
    upper = plain_axes(figure, (0.085, 0.45, 0.885, 0.4), "share of the receivers that received, with 95 % intervals")
    lower = plain_axes(figure, (0.085, 0.13, 0.885, 0.2), "receivers that packets on air were meant for")
    draw_ratio(upper, table, static.range_m)
    draw_intended(lower, table)
    save(figure, to)

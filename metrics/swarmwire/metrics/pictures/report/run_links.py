"""The PDR of each link: a matrix, or for many robots a histogram."""

from typing import Any

import numpy as np
import polars as pl

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.observe.truth import Static
from swarmwire.comms.robot.packets import FATE_NAMES, Fate
from swarmwire.metrics.pictures.drawing.canvas import CURVE, FLOOR, INK, PAPER, SMALL_PT, SOFT, plain_axes
from swarmwire.metrics.pictures.report.page import COLUMN_IN, Figure, blank_figure, drawn_figure
from swarmwire.metrics.pictures.report.run_data import RunData
from swarmwire.metrics.text import counted, share, short, shortened

_BINS = 25
MAX_NAMED = 14  # a matrix of at most this many robots has their names and percents
MAX_LETTERS = 11  # letters of a name
_MAX_LETTERS_ACROSS = 44
_PALE = 0.5  # cells of greater ratios are pale and have dark letters
_LEFT_IN, _RIGHT_IN, _TOP_IN, _BAR_IN = 0.62, 0.1, 0.26, 0.07
_FOOT_IN, _NAME_IN = 0.5, 0.055  # margin below names, and height of each of their letters
MAX_SQUARES = 60  # greatest number of robots in a matrix
MIN_PACKETS = 10  # the histogram counts links with at least this many packets in range
NAME = "links"


def link_histogram(link_pdr: FloatArray) -> Any:
    """Draw the histogram of links by ratio (k,)."""
    figure = blank_figure(COLUMN_IN, 2.0)
    axes = plain_axes(figure, (0.13, 0.21, 0.84, 0.65), "links by the share of their packets that was received")
    counts, edges = np.histogram(link_pdr, np.linspace(0.0, 1.0, _BINS + 1))
    axes.stairs(counts, edges, fill=True, color=CURVE, alpha=0.75)
    axes.axvline(float(np.median(link_pdr)), color=INK, lw=0.8, ls=(0, (4, 2)))
    axes.set_xlim(0.0, 1.0)
    axes.locator_params(axis="y", nbins=4, integer=True)
    axes.yaxis.set_major_formatter(short)
    axes.set_xlabel("share received of the packets in range", fontsize=SMALL_PT, color=SOFT, labelpad=2)
    axes.set_ylabel("links (sender to receiver)", fontsize=SMALL_PT, color=SOFT, labelpad=2)
    return figure


def link_matrix(static: Static, link_pdr: FloatArray) -> Any:
    """Draw the matrix of ratios (n, n), a row for each sender; NaN: never in range, or the robot itself."""
    names, vertical = _names(static)
    side_in = COLUMN_IN - _LEFT_IN - _RIGHT_IN
    foot_in = _FOOT_IN + (_NAME_IN * max(map(len, names.values())) if vertical else 0.15)
    height_in = _TOP_IN + side_in + foot_in
    figure = blank_figure(COLUMN_IN, height_in)
    axes = figure.add_axes((_LEFT_IN / COLUMN_IN, foot_in / height_in, side_in / COLUMN_IN, side_in / height_in))
    shown = axes.imshow(np.ma.masked_invalid(link_pdr), cmap="cividis", vmin=0.0, vmax=1.0, interpolation="none")
    axes.set_facecolor(FLOOR)
    axes.spines[:].set_visible(False)
    axes.tick_params(labelsize=SMALL_PT, colors=SOFT, length=0, pad=2)
    axes.set_yticks(list(names), list(names.values()))
    axes.set_xticks(list(names), list(names.values()), rotation=90 if vertical else 0)
    if static.robots <= MAX_NAMED:
        _write_percents(axes, link_pdr)
    for group in static.groups[1:]:
        for line in (axes.axhline, axes.axvline):
            line(group.start - 0.5, color=PAPER, lw=1.2)
    axes.set_title(
        "percent received, by sender (rows) and receiver", loc="left", fontsize=SMALL_PT + 1, color=SOFT, pad=4
    )
    below = figure.add_axes(((COLUMN_IN - 1.7) / COLUMN_IN, 0.26 / height_in, 1.5 / COLUMN_IN, _BAR_IN / height_in))
    bar = figure.colorbar(shown, cax=below, orientation="horizontal", ticks=[0.0, 0.5, 1.0], format="{x:.0%}")
    bar.outline.set_visible(False)
    below.tick_params(labelsize=SMALL_PT, colors=SOFT, length=0, pad=2)
    style = {"fontsize": SMALL_PT, "color": SOFT, "va": "center"}
    figure.text((COLUMN_IN - 1.8) / COLUMN_IN, 0.295 / height_in, "pale grey: never in range", ha="right", **style)
    return figure


def _names(static: Static) -> tuple[dict[float, str], bool]:
    """Return labels by position (of robots, or of groups if robots are many), and True if they are vertical."""
    if static.robots <= MAX_NAMED:
        names: dict[float, str] = dict(enumerate(static.robot_names))
    else:
        names = {0.5 * (group.start + group.stop - 1): group.name for group in static.groups}
    names = {position: shortened(name, MAX_LETTERS) for position, name in names.items()}
    return names, sum(len(name) + 1 for name in names.values()) > _MAX_LETTERS_ACROSS


def _write_percents(axes: Any, link_pdr: FloatArray) -> None:
    for sender, receiver in np.argwhere(np.isfinite(link_pdr)).tolist():
        ratio = link_pdr[sender, receiver]
        color = PAPER if ratio < _PALE else INK
        axes.text(receiver, sender, f"{100 * ratio:.0f}", ha="center", va="center", fontsize=5.5, color=color)


def links(run: RunData) -> Figure | str:
    """Return the figure of delivery by link, or the reason for its absence."""
    table = _packets_by_link(run)
    if isinstance(table, str):
        return f"Delivery by link: {table}"
    received, in_range = link_counts(table, run.static.robots)
    if not in_range.any():
        return "Delivery by link: no two robots were in range."
    link_pdr = np.divide(received, in_range, out=np.full(received.shape, np.nan), where=in_range > 0)
    if run.static.robots <= MAX_SQUARES:
        caption = "link_pdr of each link: received / in range (and sight), of packets that went on air."
        return drawn_figure(NAME, link_matrix(run.static, link_pdr), caption)
    busy = link_pdr[in_range >= MIN_PACKETS]
    if not len(busy):
        return f"Delivery by link: no link had {MIN_PACKETS} packets in range."
    caption = (
        f"link_pdr (received / in range) of the {counted(len(busy), 'link')} with at least {MIN_PACKETS} packets in "
        f"range; the dashed line is their median, {share(float(np.median(busy)))}."
    )
    return drawn_figure(NAME, link_histogram(busy), caption)


def _packets_by_link(run: RunData) -> pl.DataFrame | str:
    """Return the packets by sender, receiver and fate, or the reason for their absence."""
    table = run.table("radio_links")
    if not isinstance(table, str):
        return table
    packets = run.packets(("sender", "receiver", "fate"))
    if isinstance(packets, str):
        recorded = [name for name in ("radio_links", "packets") if run.folder.files(name)]
        return f"{table} {packets}" if recorded else "neither `radio_links` nor `packets` was recorded."
    return packets.group_by("sender", "receiver", "fate").agg(pl.len().alias("packets"))


def link_counts(table: pl.DataFrame, robots: int) -> tuple[IntArray, IntArray]:
    """Return the packets received, and those with the receiver in range, (n, n) each, from a table of fates.

    Packets of any fate but `blocked` are in range, equal to the summary's count.
    """
    fate = table["fate"].cast(str).to_numpy()
    link = table["sender"].to_numpy(), table["receiver"].to_numpy()
    packets = table["packets"].to_numpy()
    received, in_range = (np.zeros((robots, robots), np.int64) for _ in range(2))
    np.add.at(received, link, np.where(fate == FATE_NAMES[Fate.RECEIVED], packets, 0))
    np.add.at(in_range, link, np.where(fate != FATE_NAMES[Fate.BLOCKED], packets, 0))
    return received, in_range

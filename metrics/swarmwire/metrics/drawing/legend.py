"""The legend of an arena: groups, states, the dead, links and whatever else a picture shows."""

from itertools import pairwise
from typing import Any

from swarmwire.comms.truth import Group, Static
from swarmwire.metrics.drawing.looks import (
    DEAD,
    INK,
    LIGHT,
    LIGHT_EDGE,
    LINK,
    MOVABLE,
    MOVABLE_DASHES,
    MOVABLE_EDGE,
    OTHER_STATE,
    PAPER,
    STATE_COLORS,
    TEXT_PT,
    Look,
    rgb,
    shade,
)
from swarmwire.metrics.palette import Color, robot_color

_LETTER_IN, _HANDLE_IN = 0.062, 0.4  # widths, roughly: of a letter of a legend, and of what stands before a text


def group_entries(static: Static, filled: bool = True, bodies: bool = False) -> list[Any]:
    """An entry per group, with the count and if wanted the name of its robots; not filled: its rim alone."""
    return [
        _disc(_named(g, bodies), robot_color(i) if filled else None, robot_color(i))
        for i, g in enumerate(static.groups)
    ]


def state_entries(names: tuple[str, ...], others: bool) -> list[Any]:
    """An entry per state, which has the colour of its place, and one for robots in none of them if there are such."""
    entries = [_disc(name, color, color) for name, color in zip(names, STATE_COLORS, strict=False)]
    return [*entries, _disc("other", OTHER_STATE, OTHER_STATE)] if others else entries


def dead_entry() -> Any:
    """The entry of the dead."""
    return _disc("dead", DEAD, DEAD)


def link_entry(range_m: float) -> Any:
    """The entry of lines between robots."""
    from matplotlib.lines import Line2D

    return Line2D([], [], color=LINK, lw=1.0, alpha=0.8, label=f"in sight within {range_m:g} m (radio)")


def light_entry() -> Any:
    """The entry of lights."""
    from matplotlib.lines import Line2D

    look: Look = {"markerfacecolor": LIGHT, "markeredgecolor": LIGHT_EDGE, "markersize": 4.5}
    return Line2D([], [], linestyle="none", marker="o", label="light", **look)


def movable_entry() -> Any:
    """The entry of obstacles that robots can push."""
    from matplotlib.patches import Patch

    return Patch(facecolor=MOVABLE, edgecolor=MOVABLE_EDGE, linestyle=MOVABLE_DASHES, lw=0.8, label="movable")


def columns_in(entries: list[Any], width_in: float) -> int:
    """How many columns of entries, which fill one column after the other, stand side by side in this width."""
    letters = [len(entry.get_label()) for entry in entries]
    for columns in range(len(letters), 1, -1):
        full, rest = divmod(len(letters), columns)
        starts = [column * full + min(column, rest) for column in range(columns + 1)]
        widest = [max(letters[first:after]) for first, after in pairwise(starts)]
        if sum(_HANDLE_IN + _LETTER_IN * most for most in widest) <= width_in:
            return columns
    return 1


def add_legend(figure: Any, entries: list[Any], left: float, top: float, columns: int) -> None:
    """Add it with its upper left corner at these shares of the figure."""
    if not entries:
        return
    figure.legend(
        handles=entries,
        loc="upper left",
        bbox_to_anchor=(left, top),
        ncols=columns,
        frameon=False,
        fontsize=TEXT_PT,
        labelcolor=INK,
        borderpad=0.0,
        borderaxespad=0.0,
        labelspacing=0.55,
        handlelength=1.7,
        handletextpad=0.5,
        columnspacing=1.3,
    )


def _named(group: Group, body: bool) -> str:
    count = group.stop - group.start
    up = f", {group.body.altitude_m:g} m up" if group.body.altitude_m else ""
    return (f"{group.name}: {count} {group.body.name}" if body else f"{group.name} ({count})") + up


def _disc(label: str, fill: Color | None, rim: Color) -> Any:
    from matplotlib.lines import Line2D

    face = PAPER if fill is None else rgb(fill)
    look: Look = {"markerfacecolor": face, "markeredgecolor": shade(rim), "markeredgewidth": 1.0, "markersize": 6.0}
    return Line2D([], [], linestyle="none", marker="o", label=label, **look)

"""Colours of a recording, legible on dark and light ground, and the classes of robots: by group and state, the dead."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swarmwire.comms.base.arrays import BoolArray, IntArray
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.pictures.drawing.canvas import Color, robot_color
from swarmwire.metrics.pictures.viewer.rows import RerunRows

DEAD = (118, 118, 124)
WALL = (125, 130, 145)
LIGHT = (230, 180, 30)
MARK = (118, 124, 142)

SERIES: tuple[Color, ...] = (
    (45, 145, 215),
    (185, 140, 0),
    (0, 160, 105),
    (220, 105, 30),
    (200, 95, 155),
    (135, 135, 148),
)

_LAST_LETTER = "\u024f"  # of Latin with its extensions
DEAD_CLASS = 0
LEGEND_LINES, KEY_LINES = 6, 8  # as many as the layout has room for, of robots and of a plot
_LONGEST_LINE = 28  # characters
_LABELLED = 1.0  # radius in ui points of the dot that a line of the legend hangs on


def packed(color: Color, alpha: int) -> int:
    """A colour and its opacity of 255 as the number 0xRRGGBBAA, which rerun takes fastest."""
    red, green, blue = color
    return red << 24 | green << 16 | blue << 8 | alpha


def shown(text: str) -> str:
    """The text with `?` for letters that the viewer's only font may lack: drawing without a screen, it ends at one."""
    return "".join(letter if " " <= letter <= _LAST_LETTER else "?" for letter in text)


class RerunClasses:
    """Class ids of robots: 0 for the dead, and one per (group, state), given in the order in which they appear.

    The names are logged as rerun's annotations of `world`, so that a robot says what it is when it is pointed at, and
    as a legend in which each name has its colour; both again whenever there is a new class. The annotations are rows
    of their ticks: rerun forgets a constant annotation that is logged again. Each robot's colour is logged beside its
    class, since a live viewer also forgets annotations with its oldest ticks.
    """

    def __init__(self, static: Static) -> None:
        """No class but the dead yet."""
        self._static = static
        self._group = np.concatenate([np.full(g.stop - g.start, i) for i, g in enumerate(static.groups)])
        self._id: dict[tuple[int, int], int] = {}  # (group, state code) to class
        self._names = ["dead"]
        self._colors: list[Color] = [DEAD]
        self._died = False

    def assign(
        self, rows: RerunRows, alive: BoolArray, state: IntArray, states: tuple[str, ...]
    ) -> tuple[IntArray, NDArray[np.uint32]]:
        """Each robot's class and colour, (robots,), from alive and its index in `states`; logs new classes."""
        codes = len(states)
        keys, inverse = np.unique(self._group * codes + state, return_inverse=True)
        known = len(self._id), self._died
        ids = np.array([self._class(int(key) // codes, int(key) % codes, states) for key in keys], np.uint16)
        self._died |= not alive.all()
        if known != (len(self._id), self._died):
            self._log(rows)
        ids = np.where(alive, ids[inverse], np.uint16(DEAD_CLASS))
        return ids, np.array([packed(color, 255) for color in self._colors], np.uint32)[ids]

    def _class(self, group: int, code: int, states: tuple[str, ...]) -> int:
        if (group, code) not in self._id:
            self._id[group, code] = len(self._names)
            self._colors.append(robot_color(len(self._names) - 1))
            self._names.append(shown(self._name(self._static.groups[group].name, states[code])))
        return self._id[group, code]

    def _name(self, group: str, state: str) -> str:
        """The name of a class; the group's name is left out where there is only one group."""
        if not state:
            return group
        return state if len(self._static.groups) == 1 else f"{group}: {state}"

    def _log(self, rows: RerunRows) -> None:
        import rerun as rr

        described: Any = list(zip(range(len(self._names)), self._names, self._colors, strict=True))
        rows.send_now("world", rr.AnnotationContext.columns(context=described))
        lines = list(zip(self._names, self._colors, strict=True))[1:] + [("dead: crossed out", DEAD)] * self._died
        log_legend(rows.rec, "legend", lines, LEGEND_LINES)


def log_legend(rec: Any, entity: str, lines: Sequence[tuple[str, Color]], most: int) -> None:
    """Log names in their colours below one another; of more than `most` it says how many are left out."""
    import rerun as rr

    if len(lines) > most:
        lines = [*lines[: most - 1], (f"... and {len(lines) - most + 1} more", DEAD)]
    texts = [text if len(text) <= _LONGEST_LINE else f"{text[: _LONGEST_LINE - 3]}..." for text, _ in lines]
    at = [(0.0, float(line)) for line in range(len(lines))]
    dot = rr.Radius.ui_points(_LABELLED)
    points = rr.Points2D(at, radii=dot, labels=texts, colors=[color for _, color in lines], show_labels=True)
    rec.log(entity, points, static=True)

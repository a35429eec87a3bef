"""Colours of a recording, legible on dark and light backgrounds, and classes of robots by group and state."""

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

_LAST_LETTER = "\u024f"  # last letter of Latin Extended-B
DEAD_CLASS = 0
LEGEND_LINES, KEY_LINES = 6, 8  # lines in the layout of robots and of a plot
_MAX_LINE_LENGTH = 28
_DOT_RADIUS = 1.0  # radius of the dot of a line of the legend, in ui points


def packed(color: Color, alpha: int) -> int:
    """Return a colour and its opacity (0 to 255) as 0xRRGGBBAA, rerun's fastest format."""
    red, green, blue = color
    return red << 24 | green << 16 | blue << 8 | alpha


def printable(text: str) -> str:
    """Replace letters that the viewer's font may lack by `?`: without a screen, the viewer crashes at such a letter."""
    return "".join(letter if " " <= letter <= _LAST_LETTER else "?" for letter in text)


class RerunClasses:
    """Class ids of robots: 0 for dead robots, and one per (group, state), in order of appearance.

    Names are logged as rerun's annotations of `world`, which the viewer shows at a robot under the pointer, and as a
    legend in their colours; both again with each new class. Annotations are rows of their ticks, since rerun forgets a
    constant annotation that is logged again. Each robot's colour is logged with its class, since a live viewer also
    forgets annotations with its oldest ticks.
    """

    def __init__(self, static: Static) -> None:
        """Create the class of dead robots."""
        self._static = static
        self._group = np.concatenate([np.full(g.stop - g.start, i) for i, g in enumerate(static.groups)])
        self._id: dict[tuple[int, int], int] = {}  # (group, state code) to class
        self._names = ["dead"]
        self._colors: list[Color] = [DEAD]
        self._died = False

    def assign(
        self, rows: RerunRows, alive: BoolArray, state: IntArray, states: tuple[str, ...]
    ) -> tuple[IntArray, NDArray[np.uint32]]:
        """Return each robot's class and colour, (robots,), from alive and index in `states`; log new classes."""
        codes = len(states)
        keys, inverse = np.unique(self._group * codes + state, return_inverse=True)
        before = len(self._id), self._died
        ids = np.array([self._class(int(key) // codes, int(key) % codes, states) for key in keys], np.uint16)
        self._died |= not alive.all()
        if before != (len(self._id), self._died):
            self._log(rows)
        ids = np.where(alive, ids[inverse], np.uint16(DEAD_CLASS))
        return ids, np.array([packed(color, 255) for color in self._colors], np.uint32)[ids]

    def _class(self, group: int, code: int, states: tuple[str, ...]) -> int:
        if (group, code) not in self._id:
            self._id[group, code] = len(self._names)
            self._colors.append(robot_color(len(self._names) - 1))
            self._names.append(printable(self._name(self._static.groups[group].name, states[code])))
        return self._id[group, code]

    def _name(self, group: str, state: str) -> str:
        """Return the name of a class, without the group's name if there is only one group."""
        if not state:
            return group
        return state if len(self._static.groups) == 1 else f"{group}: {state}"

    def _log(self, rows: RerunRows) -> None:
        import rerun as rr

        described: Any = list(zip(range(len(self._names)), self._names, self._colors, strict=True))
        rows.send_now("world", rr.AnnotationContext.columns(context=described))
        lines = list(zip(self._names, self._colors, strict=True))[1:] + [("dead: crossed out", DEAD)] * self._died
        log_legend(rows.rec, "legend", lines, LEGEND_LINES)


def log_legend(rec: Any, entity: str, lines: Sequence[tuple[str, Color]], max_lines: int) -> None:
    """Log names in their colours, a line each; beyond `max_lines` the last line is the number of others."""
    import rerun as rr

    if len(lines) > max_lines:
        lines = [*lines[: max_lines - 1], (f"... and {len(lines) - max_lines + 1} more", DEAD)]
    texts = [text if len(text) <= _MAX_LINE_LENGTH else f"{text[: _MAX_LINE_LENGTH - 3]}..." for text, _ in lines]
    positions = [(0.0, float(line)) for line in range(len(lines))]
    dot = rr.Radius.ui_points(_DOT_RADIUS)
    points = rr.Points2D(positions, radii=dot, labels=texts, colors=[color for _, color in lines], show_labels=True)
    rec.log(entity, points, static=True)

"""Recorded packets as lines of a film: from sender to receiver if received, else a part of the way."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl

from swarmwire.comms.base.arrays import AnyArray, FloatArray, IntArray
from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.observe.truth import Static
from swarmwire.comms.robot.packets import FATE_NAMES, Fate
from swarmwire.metrics.measures.torus import link_lines, shortest_displacement
from swarmwire.metrics.pictures.drawing.canvas import CURVE, FATE_COLORS, rgb
from swarmwire.metrics.pictures.drawing.film import Film
from swarmwire.metrics.records.run_folder.packets import PacketsTable
from swarmwire.metrics.records.run_folder.reader import RunFolder

# A received packet is darker than in the viewer; a fate without a colour has no lines.
_COLORS = {fate: rgb(color) for fate, color in FATE_COLORS.items()} | {Fate.RECEIVED: CURVE}
_OPACITY, _MIN_OPACITY, _MAX_OPACITY = 8.0, 0.3, 0.85  # _OPACITY / sqrt(lines), within the bounds
REACHED = 0.4  # length of the line of a packet that was not received, as a share of the way


@dataclass(frozen=True)
class PacketEnds:
    """The final fates of an arena's packets, a row per receiver, in the order of the ticks before which they ended."""

    first: IntArray  # (ticks + 1,) first row of each tick
    sender: IntArray  # (k,) index in the arena
    receiver: IntArray  # (k,)
    fate: IntArray  # (k,) a Fate

    def ended_in(self, tick: int) -> tuple[IntArray, IntArray]:
        """Return senders and receivers (e, 2), and fates (e,), of rows that ended since the previous tick."""
        rows = slice(self.first[tick], self.first[tick + 1])
        return np.column_stack([self.sender[rows], self.receiver[rows]]), self.fate[rows]

    @property
    def fates(self) -> tuple[Fate, ...]:
        """The fates that occurred, received first."""
        return tuple(Fate(number) for number in np.unique(self.fate).tolist())


def packets_of(recorded: RunFolder, film: Film) -> PacketEnds | None:
    """Return the packets of a film; None if the run recorded no packets. BadInput for a damaged table."""
    if not recorded.files(PacketsTable.name):
        return None
    table = recorded.validated(PacketsTable.name, film.arena)
    frame = table.drop_nulls("receiver").sort("final_at_ns", maintain_order=True)
    starts_ns = np.round(NS_PER_S * film.time_s)
    ended = np.searchsorted(frame["final_at_ns"].to_numpy(), starts_ns, side="right")
    columns = frame["sender"], frame["receiver"], frame["fate"].to_physical()
    return PacketEnds(np.concatenate([[0], ended]), *(column.cast(pl.Int64).to_numpy() for column in columns))


class PacketLines:
    """Lines of the packets of one tick."""

    def __init__(self, axes: Any, static: Static) -> None:
        """Add the collections, empty, to axes in m."""
        from matplotlib.collections import LineCollection

        self._static = static
        self._received: Any = LineCollection([], colors=_COLORS[Fate.RECEIVED], linewidths=0.7, zorder=2.1)
        self._missed: Any = LineCollection([], linewidths=1.2, zorder=2)
        for artist in self.artists:
            axes.add_collection(artist, autolim=False)

    @property
    def artists(self) -> tuple[Any, ...]:
        """Moving artists in drawing order."""
        return self._missed, self._received

    def show(self, position_m: AnyArray, ends: IntArray, fate: IntArray) -> None:
        """Show packets between senders and receivers (e, 2) at positions (n, 2), with these fates (e,)."""
        position_m, received = position_m.astype(np.float64), fate == Fate.RECEIVED
        self._received.set_segments(link_lines(position_m, ends[received], self._static))
        self._missed.set_segments(_cut_off(position_m, ends[~received], self._static))
        self._missed.set_color([_COLORS[Fate(number)] for number in fate[~received].tolist()])
        for lines, shown in ((self._received, received), (self._missed, ~received)):
            lines.set_alpha(float(np.clip(_OPACITY / np.sqrt(max(shown.sum(), 1)), _MIN_OPACITY, _MAX_OPACITY)))


def _cut_off(position_m: FloatArray, ends: IntArray, static: Static) -> FloatArray:
    """Return lines (e, 2, 2) from each sender a part of the way to its receiver."""
    start = position_m[ends[:, 0]]
    way = shortest_displacement(position_m[ends[:, 1]] - start, static)
    return np.stack([start, start + REACHED * way], axis=1)


def packet_entries(fates: tuple[Fate, ...]) -> list[Any]:
    """Return the entries of a legend for lines of packets."""
    from matplotlib.lines import Line2D

    names = ((fate, FATE_NAMES[fate].replace("_", " ")) for fate in fates)
    return [Line2D([], [], color=_COLORS[fate], lw=1.2, label=name) for fate, name in names]

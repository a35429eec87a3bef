"""Draws docs/hero.gif: one flock from one start under three packet losses, side by side.

`python -m docs.pictures.hero`

The scenario is a shipped one; without its stop condition, so that all three runs last as long. Seed 4 is a typical one:
of the seeds 1 to 30, its mean orders over these 24 s are nearest to the medians of the 30 at the three losses.
"""

# pyright: basic, reportUnknownMemberType=false

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import ByteArray, FloatArray
from swarmwire.comms.robot.packets import Fate
from swarmwire.deploy import Recording, RunFolder, run
from swarmwire.metrics.pictures.drawing.animation import write_gif
from swarmwire.metrics.pictures.drawing.canvas import CURVE, FAINT, INK, SOFT, new_figure, pixels, plain_axes
from swarmwire.metrics.pictures.drawing.film import Film, film_of
from swarmwire.metrics.pictures.drawing.packets import PacketEnds, PacketLines, packet_entries, packets_of
from swarmwire.metrics.pictures.drawing.scene import draw_scenery
from swarmwire.metrics.pictures.drawing.swarm import SwarmArtist

TO = Path(__file__).parents[1] / "hero.gif"
SCENARIO, SEED, LOSSES, UNTIL_S = "scenarios/aligning.toml", 4, (0.0, 0.6, 0.95), 24.0
ALIGNED, HOLD_S = 0.9, 5.0  # as the scenario's stop condition has it
EVERY_TICKS, FRAMES_PER_S, LAST_S = 2, 10.0, 1.5  # the last frame stays for a while
WIDTH_IN, HEIGHT_IN, SIZE_PX = 9.6, 5.0, 960
PANEL_IN, APART_IN, LOW_IN = 3.0, 0.15, 1.18  # panels: sides, distances, above the lower edge
VIEW_X_M, VIEW_Y_M = (-2.65, 4.05), (-3.35, 3.35)  # of the arena: where the robots go
ROBOTS = 0.016  # least radius of a disc by the arena's side: they are drawn larger than in other pictures
TRAIL_S = 3.0
HEAD_PT, TEXT_PT = 13.0, 10.5


class Panel:
    """One run: the arena above, the order of headings over time below."""

    def __init__(self, figure: Any, left_in: float, loss: float, film: Film, packets: PacketEnds) -> None:
        """Draw the fixed parts."""
        self._film, self._packets = film, packets
        self._order: FloatArray = film.metrics["order"]
        self._since_s = aligned_since_s(film.time_s, self._order)
        left, across = left_in / WIDTH_IN, PANEL_IN / WIDTH_IN
        arena = figure.add_axes((left, LOW_IN / HEIGHT_IN, across, PANEL_IN / HEIGHT_IN))
        arena.set(xlim=VIEW_X_M, ylim=VIEW_Y_M, aspect="equal")
        arena.set_axis_off()
        draw_scenery(arena, film.static, film.arena)
        self._lines, self.swarm = PacketLines(arena, film.static), SwarmArtist(arena, film.static, ROBOTS)
        title_y = (LOW_IN + PANEL_IN + 0.09) / HEIGHT_IN
        figure.text(
            left, title_y, f"{100 * loss:.0f} % of packets lost", fontsize=HEAD_PT, fontweight="bold", color=INK
        )

        plot = plain_axes(figure, (left + 0.025, 0.092, across - 0.025, 0.083), "")
        plot.set(xlim=(0.0, UNTIL_S), ylim=(-0.03, 1.05), yticks=(0.0, 1.0), xticks=(0, 10, 20))
        plot.set_xticklabels(("0", "10 s", "20 s"))
        plot.tick_params(labelsize=TEXT_PT - 1.0)
        plot.plot(film.time_s, self._order, color=FAINT, lw=1.0)
        [self._past] = plot.plot([], [], color=CURVE, lw=1.8)
        [self._dot] = plot.plot([], [], "o", color=CURVE, ms=5.0, mec="white", mew=0.8, clip_on=False, zorder=4)
        number_y = 0.19
        self._number: Any = figure.text(left, number_y, "", fontsize=TEXT_PT + 0.5, fontweight="bold", color=INK)
        self._note: Any = figure.text(left + across, number_y, "", fontsize=TEXT_PT, color=SOFT, ha="right")

    @property
    def artists(self) -> tuple[Any, ...]:
        """Everything that moves, in the order in which it is drawn."""
        return (*self._lines.artists, *self.swarm.artists, self._past, self._dot, self._number, self._note)

    def show(self, tick: int) -> None:
        """Move to a tick of the run."""
        film, now_s, order = self._film, self._film.time_s[tick], self._order[tick]
        self._lines.show(film.pose[tick, :, :2], *self._packets.ended_in(tick))
        since = film.index_at(now_s - TRAIL_S)
        self.swarm.show(film.pose[tick], film.alive[tick], trail=film.pose[since : tick + 1, :, :2])
        self._past.set_data(film.time_s[: tick + 1], self._order[: tick + 1])
        self._dot.set_data([now_s], [order])
        self._number.set_text(f"order {order:.2f}")
        aligned = self._since_s is not None and now_s >= self._since_s
        self._note.set_text(f"aligned since {self._since_s:.1f} s" if aligned else "not aligned")


def aligned_since_s(time_s: FloatArray, order: FloatArray) -> float | None:
    """From when on the order was high enough for the time of the scenario's stop condition; None: it never was."""
    for start in np.flatnonzero(order >= ALIGNED):
        held = order[start : np.searchsorted(time_s, time_s[start] + HOLD_S)]
        if time_s[-1] - time_s[start] >= HOLD_S and (held >= ALIGNED).all():
            return float(time_s[start])
    return None


class Hero:
    """The whole picture: the three runs, a legend and the time."""

    def __init__(self, folders: list[RunFolder]) -> None:
        """Draw the fixed parts."""
        self._figure = figure = new_figure(WIDTH_IN, HEIGHT_IN, SIZE_PX)
        edge_in = 0.5 * (WIDTH_IN - 3 * PANEL_IN - 2 * APART_IN)
        films = [film_of(folder, 0, str(folder.path)) for folder in folders]
        packets = [packets_of(folder, film) for folder, film in zip(folders, films, strict=True)]
        self._panels = [
            Panel(figure, edge_in + i * (PANEL_IN + APART_IN), loss, film, ends)
            for i, (loss, film, ends) in enumerate(zip(LOSSES, films, packets, strict=True))
            if ends is not None
        ]
        left, right, top = edge_in / WIDTH_IN, 1.0 - edge_in / WIDTH_IN, 1.0 - 0.3 / HEIGHT_IN
        caption = f"{films[0].static.robots} e-pucks, one start, three radios"
        figure.text(left, top, caption, fontsize=HEAD_PT + 2.0, fontweight="bold", color=INK)
        self._time: Any = figure.text(right, top, "", fontsize=HEAD_PT, color=INK, ha="right")
        look: dict[str, Any] = {"frameon": False, "fontsize": TEXT_PT, "labelcolor": INK, "borderaxespad": 0.0}
        entries = packet_entries((Fate.RECEIVED, Fate.LOST))
        figure.legend(handles=entries, loc="center right", bbox_to_anchor=(right - 0.115, top + 0.013), ncols=2, **look)
        speed = EVERY_TICKS * FRAMES_PER_S / films[0].static.rate_hz
        note = f"{SCENARIO}, seed {SEED}; {speed:g} x real time; {self._panels[0].swarm.enlargement}"
        figure.text(right, 0.008, note, fontsize=TEXT_PT - 1.5, color=SOFT, ha="right")
        explained = "order: 1 if all head the same way"
        figure.text(left, 0.008, explained, fontsize=TEXT_PT - 1.5, color=SOFT)
        self._still: Any = None

    def frame(self, tick: int) -> ByteArray:
        """The pixels of a tick, (height, width, 3)."""
        moving = [artist for panel in self._panels for artist in panel.artists] + [self._time]
        canvas = self._figure.canvas
        if self._still is None:
            for artist in moving:
                artist.set_animated(True)
            canvas.draw()
            self._still = canvas.copy_from_bbox(self._figure.bbox)
        for panel in self._panels:
            panel.show(tick)
        self._time.set_text(f"t = {tick / self._panels[0]._film.static.rate_hz:.1f} s")
        canvas.restore_region(self._still)
        for artist in moving:
            self._figure.draw_artist(artist)
        return pixels(self._figure).copy()


def draw(to: Path = TO) -> None:
    """Run the scenario at each loss and write the film."""
    with TemporaryDirectory() as home:
        folders: list[RunFolder] = []
        for loss in LOSSES:
            out = Path(home, f"{loss:g}")
            overrides = [f"radio.loss={loss}", f"duration_s={UNTIL_S}", "stop=[]"]
            run(TO.parents[1] / SCENARIO, seed=SEED, overrides=overrides, out=out, record=Recording(packets=1.0))
            folders.append(RunFolder(out))
        hero = Hero(folders)
        last = folders[0].ticks(0).height - 1
        frames = [hero.frame(tick) for tick in range(0, last + 1, EVERY_TICKS)]
        frames += [frames[-1]] * round(LAST_S * FRAMES_PER_S)
        write_gif(to, iter(frames), frames[::15], FRAMES_PER_S)


if __name__ == "__main__":
    draw()

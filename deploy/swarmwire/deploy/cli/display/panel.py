"""The live panel of a run in a terminal: its keys, how it looks, and when it is drawn."""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

from rich.console import Console, ConsoleOptions, Group, RenderResult
from rich.live import Live
from rich.panel import Panel as Frame
from rich.text import Text

from swarmwire.comms.base.clock import Clock, to_ns
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.comms.robot.packets import FATE_NAMES
from swarmwire.deploy.cli.display.figures import EVENTS, HISTORY_S, Figures
from swarmwire.deploy.cli.display.keys import KeyListener
from swarmwire.deploy.runs.controls import Controls
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.world.backends.runner_reports import RunnerHealth

REDRAW_NS, SELDOM_NS = to_ns(0.1), to_ns(0.5)  # wall time between two pictures, at least and at most
COST = 250  # a picture that took so long is followed by so many times as long without one: below 1 % of a run


class Panel(Observer):
    """Observer that shows how a run is doing, and hands the keys that people type to its controls."""

    def __init__(
        self,
        ticks: int,
        metrics: Metrics,
        controls: Controls,
        health: Callable[[], RunnerHealth | None],
        clock: Clock,
        console: Console,
        compiled_ns: Callable[[], int] = lambda: 0,
    ) -> None:
        """Of a run of so many ticks; `metrics` must see each tick before; `health` gives None without runners.

        `compiled_ns` gives the wall time spent on compiling so far.
        """
        self._controls, self._health, self._clock, self._console = controls, health, clock, console
        self.figures = Figures(ticks, metrics, clock, compiled_ns)
        self._keys = KeyListener(partial(press, controls))
        self._live = Live(self, console=console, auto_refresh=False, transient=True, vertical_overflow="crop")
        self._next_ns = 0  # no picture before
        self._broken: Exception | None = None

    def begin(self, static: Static) -> None:
        """Show it."""
        self.figures.begin(static)
        self._controls.on_wait = self._wait
        self._keys.start()
        try:
            self._live.start()
            self._draw()
        except BaseException:  # also Ctrl-C and rich's SystemExit must not leave the terminal without its echo
            self.end(None)
            raise

    def see(self, truth: Truth) -> None:
        """Add a tick, and draw it if it is time; OSError if the terminal is gone."""
        self.figures.see(truth)
        if self._broken is not None:
            self._controls.on_wait = lambda: None
            raise self._broken
        if self._clock.now_ns() >= self._next_ns:
            cost_ns = self._draw()
            self._next_ns += min(max(COST * cost_ns, REDRAW_NS), SELDOM_NS) - REDRAW_NS

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Take it away."""
        self._controls.on_wait = lambda: None
        try:
            self._live.stop()
        finally:
            self._keys.stop()
        return {}

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """The panel of this moment."""
        yield panel_view(self.figures, self._controls, self._health(), options.max_width, keys=self._keys.active)

    def _wait(self) -> None:
        """The loop is held: no tick comes, but people may have asked for something."""
        if self._controls.paused:
            self.figures.forget_speed()
        if self._broken is None and self._clock.now_ns() >= self._next_ns:
            try:
                self._draw()
            except Exception as error:  # noqa: BLE001 - nothing catches it here; the next tick reports it
                self._broken = error

    def _draw(self) -> int:
        """Returns how long it took, in ns."""
        before_ns = self._clock.now_ns()
        self._live.refresh()
        self._next_ns = before_ns + REDRAW_NS
        return self._clock.now_ns() - before_ns


MARGIN = 4  # columns of the frame and the blanks beside it
LABEL, VALUE = 19, 7  # columns
WIDE = 96  # columns from which a minute gets a character a second
LEGEND_LINES = 2
COLORS = {
    "received": "green",
    "out_of_range": "bright_black",
    "blocked": "yellow",
    "lost": "red",
    "blackout": "magenta",
    "partitioned": "blue",
    "receiver_dead": "cyan",
    "sender_dead": "bright_cyan",
    "queue_full": "bright_yellow",
    "too_large": "bright_magenta",
    "in_flight": "white",
}


def panel_view(figures: Figures, controls: Controls, health: RunnerHealth | None, width: int, *, keys: bool) -> Frame:
    """The panel of this moment; `health` is None without runners, `keys` says whether any are read."""
    inner = width - MARGIN
    lines = [_state(figures, controls), _progress(figures, inner), _time(figures, controls), Text()]
    lines += [_level(figures, name, width) for name in figures.levels]
    if figures.static.range_m is not None:
        lines += [_link_pdr(figures), Text(), *_fates(figures, inner)]
    if health or controls.real_time:
        lines += [Text(), _health(health, controls)]
    lines += [Text(), *(_help() if controls.help_requested else _events(figures))]
    for line in lines:
        line.truncate(inner, overflow="ellipsis")
    seeds = figures.static.seeds
    which = f"seed {seeds[0]}" if len(seeds) == 1 else f"{len(seeds)} seeds, {seeds[0]} to {seeds[-1]}: means"
    title = Text.assemble((f"{figures.static.name}  ", "bold"), (which, "dim"))
    title.truncate(inner - 2, overflow="ellipsis")
    border = "yellow" if controls.paused else "cyan"
    footer = _keys() if keys else None
    return Frame(Group(*lines), title=title, title_align="left", subtitle=footer, border_style=border, width=width)


def _state(figures: Figures, controls: Controls) -> Text:
    if controls.quit_requested:
        state = ("ending", "bold red")
    elif controls.paused:
        state = ("paused", "bold yellow")
    elif figures.compiling:
        state = ("compiling", "bold yellow")
    else:
        state = ("running", "bold green")
    speed = controls.speed
    if controls.real_time:
        asked = f"real time x {speed:g}"
    else:
        asked = "as fast as possible" if speed is None else f"at most {speed:g} x real time"
    robots = f"{figures.static.robots} robots" + (" in each arena" if figures.static.arenas > 1 else "") + figures.gone
    return Text.assemble(state, "   ", asked, "   ", (robots, "dim"))


def _progress(figures: Figures, width: int) -> Text:
    done, ticks = figures.done, figures.ticks
    label, share = f"tick {done:>{len(str(ticks))}}/{ticks} ", f" {done * 100 // ticks:3d} %"
    cells = max(width - len(label) - len(share), 0)
    full = cells * done // ticks
    return Text.assemble(label, ("━" * full, "cyan"), ("━" * (cells - full), "bright_black"), share)


def _time(figures: Figures, controls: Controls) -> Text:
    text = f"{figures.time_s:.1f} of {figures.duration_s:.1f} s simulated"
    if controls.paused or figures.compiling:
        return Text(text)
    speed = figures.speed(1.0)
    text += "" if math.isnan(speed) else f" · {_plain(speed)} x real time"
    steady = figures.speed(10.0)
    if steady > 0:
        left_s = math.ceil((figures.duration_s - figures.time_s) / steady)
        hours = f"{left_s // 3600}:" if left_s >= 3600 else ""
        text += f" · {hours}{left_s // 60 % 60:02d}:{left_s % 60:02d} left"
    return Text(text)


def _level(figures: Figures, name: str, width: int) -> Text:
    per_value_s = 1 if width >= WIDE else 2
    history = figures.history(name, per_value_s)
    shown, most = HISTORY_S // per_value_s, 1.0
    if name == "components":
        most = max((value for value in history if not math.isnan(value)), default=1.0)
    curve = sparkline(history[-shown:], 0.0, most)
    value = figures.level(name)
    text = f"{value:g}" if value.is_integer() and name == "components" else f"{value:.2f}"
    return _row(name.replace("_", " "), "-" if math.isnan(value) else text).append("  ").append(curve, "cyan")


def _link_pdr(figures: Figures) -> Text:
    line = _row("link PDR", _percent(figures.link_pdr_of_second))
    return line.append("  in the last second, ", "dim").append(_percent(figures.link_pdr)).append(" in all", "dim")


def _fates(figures: Figures, width: int) -> list[Text]:
    """A bar with a part for each fate, and what they are, commonest first."""
    total = int(figures.fates.sum())
    counts = [(name, int(count)) for name, count in zip(FATE_NAMES, figures.fates, strict=True) if count]
    bar = Text()
    before = 0
    for name, count in counts:  # each part ends where it should: what is rounded never adds up
        bar.append("█" * ((before + count) * width // total - before * width // total), COLORS.get(name, "white"))
        before += count
    if not counts:
        bar.append("no packet yet", "dim")
    legend, lines = [Text()], LEGEND_LINES
    for name, count in sorted(counts, key=lambda pair: -pair[1]):
        item = Text.assemble(("■ ", COLORS.get(name, "white")), f"{name.replace('_', ' ')} {count / total:.1%}   ")
        if legend[-1].cell_len + item.cell_len > width + 3:
            if len(legend) == lines:
                legend[-1].append("…")
                break
            legend.append(Text())
        legend[-1].append_text(item)
    return [bar, *legend, *[Text()] * (lines - len(legend))]


def _health(health: RunnerHealth | None, controls: Controls) -> Text:
    line = Text()
    if health is not None:
        line = _row("runners", str(health.ready)).append(" ready", "green")
        for count, what in (
            (health.lost, "lost"),
            (health.late_answers, "late answers"),
            (health.frames_dropped, "frames dropped"),
            (health.watchdog_stops, "stops"),
        ):
            line.append(f" · {count} {what}", "bold red" if count and what == "lost" else "yellow" if count else "dim")
    if controls.real_time:
        missed = controls.missed_ticks
        line.append(f"{' · ' if line else ''}{missed} ticks missed", "yellow" if missed else "dim")
    return line


def _events(figures: Figures) -> list[Text]:
    newest = [Text(event) for event in reversed(figures.events)]
    lines = newest or [Text("no events so far", "dim")]
    return lines + [Text()] * (EVENTS - len(lines))


def _help() -> list[Text]:
    """In two columns, as many lines as there are events."""
    items = [f"{binding.shown:>5}  {binding.help}" for binding in BINDINGS]
    half = -(-len(items) // 2)
    column = max(len(item) for item in items[:half]) + 2
    return [Text(f"{left:<{column}}{right}") for left, right in zip(items[:half], items[half:], strict=False)]


def _keys() -> Text:
    pairs = [Text.assemble((binding.shown, "bold"), f" {binding.name}") for binding in BINDINGS]
    return Text("  ").join(pairs)


def _row(label: str, value: str) -> Text:
    return Text(f"{label:<{LABEL}}").append(f"{value:>{VALUE}}", "bold")


def _percent(share: float) -> str:
    return "-" if math.isnan(share) else f"{share:.1%}"


def _plain(value: float) -> str:
    return f"{value:.1f}" if value < 100 else f"{value:.0f}"


class Binding(NamedTuple):
    """One thing to ask for."""

    keys: str  # each of these characters
    shown: str  # how people call the first of them
    name: str  # one word
    help: str
    ask: Callable[[Controls], None]


BINDINGS = (
    Binding(" ", "space", "pause", "pause or resume", Controls.toggle_pause),
    Binding("s.", "s", "step", "one tick, then pause again", Controls.step),
    Binding("+=", "+", "faster", "faster, at last without a limit", Controls.faster),
    Binding("-_", "-", "slower", "slower: limit the speed", Controls.slower),
    Binding("qQ", "q", "quit", "end after this tick", Controls.quit),
    Binding("?h", "?", "help", "show this, or no longer", Controls.toggle_help),
)


def press(controls: Controls, key: str) -> None:
    """Do what a key asks for; any other key does nothing."""
    for binding in BINDINGS:
        if key in binding.keys:
            binding.ask(controls)


BARS = "▁▂▃▄▅▆▇"  # not the full block: curves in lines below one another would touch
NOTHING = " "


def sparkline(values: Sequence[float], least: float, largest: float) -> str:
    """A character per value, from the least to the largest; a gap for NaN.

    >>> sparkline([0.0, 0.5, 1.0, math.nan], 0.0, 1.0)
    '▁▄▇ '
    """
    span = largest - least
    return "".join(
        NOTHING if math.isnan(value) else BARS[_bar_of((value - least) / span if span > 0 else 0.0)] for value in values
    )


def _bar_of(share: float) -> int:
    return min(max(math.floor(share * len(BARS)), 0), len(BARS) - 1)

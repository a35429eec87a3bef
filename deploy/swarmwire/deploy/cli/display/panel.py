"""The live panel of a run in a terminal."""

import math
from collections.abc import Callable, Sequence
from typing import Any

from rich.console import Console, ConsoleOptions, Group, RenderResult
from rich.live import Live
from rich.panel import Panel as Frame
from rich.text import Text

from swarmwire.comms.base.clock import Clock, to_ns
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.comms.robot.packets import FATE_NAMES
from swarmwire.deploy.cli.display.figures import HISTORY_S, MAX_EVENTS, Figures
from swarmwire.deploy.runs.controls import Controls
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.world.backends.runner_reports import RunnerHealth

MIN_REDRAW_NS, MAX_REDRAW_NS = to_ns(0.1), to_ns(0.5)  # wall time between two pictures
IDLE_RATIO = 250  # wall time without a picture over that of drawing one: pictures take below 1 % of a run


class Panel(Observer):
    """Observer that shows the progress of a run, its packets and its events."""

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
        """Create the panel of a run of `ticks`, each of which `metrics` must see first.

        `health` returns None without runners, `compiled_ns` the wall time spent on compiling so far.
        """
        self._controls, self._health, self._clock, self._console = controls, health, clock, console
        self.figures = Figures(ticks, metrics, clock, compiled_ns)
        self._live = Live(self, console=console, auto_refresh=False, transient=True, vertical_overflow="crop")
        self._next_ns = 0  # time of the next picture
        self._broken: Exception | None = None

    def begin(self, static: Static) -> None:
        """Show the panel."""
        self.figures.begin(static)
        self._controls.on_wait = self._wait
        try:
            self._live.start()
            self._draw()
        except BaseException:  # Ctrl-C and rich's SystemExit must leave the terminal with its cursor
            self.end(None)
            raise

    def see(self, truth: Truth) -> None:
        """Add a tick, and draw the panel if a picture is due; OSError if the terminal is gone."""
        self.figures.see(truth)
        if self._broken is not None:
            self._controls.on_wait = lambda: None
            raise self._broken
        if self._clock.now_ns() >= self._next_ns:
            idle_ns = IDLE_RATIO * self._draw()
            self._next_ns += min(max(idle_ns, MIN_REDRAW_NS), MAX_REDRAW_NS) - MIN_REDRAW_NS

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Remove the panel."""
        self._controls.on_wait = lambda: None
        self._live.stop()
        return {}

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Render the current panel."""
        yield panel_view(self.figures, self._controls, self._health(), options.max_width)

    def _wait(self) -> None:
        """Redraw the panel of a waiting loop, whose state people may have changed."""
        if self._controls.paused:
            self.figures.forget_speed()
        if self._broken is None and self._clock.now_ns() >= self._next_ns:
            try:
                self._draw()
            except Exception as error:  # noqa: BLE001 - the next tick raises it
                self._broken = error

    def _draw(self) -> int:
        """Draw the panel, and return the wall time in ns."""
        before_ns = self._clock.now_ns()
        self._live.refresh()
        self._next_ns = before_ns + MIN_REDRAW_NS
        return self._clock.now_ns() - before_ns


MARGIN = 4  # columns of the frame and the blanks beside it
LABEL, VALUE = 19, 7  # columns
WIDE = 96  # columns for a curve with a character per second
LEGEND_LINES = 2
FOOTER = "swarmwire ctl pauses, steps and disturbs it; Ctrl-C ends it"
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


def panel_view(figures: Figures, controls: Controls, health: RunnerHealth | None, width: int) -> Frame:
    """Return the present panel; `health` is None without runners."""
    inner = width - MARGIN
    lines = [_state(figures, controls), _progress(figures, inner), _time(figures, controls), Text()]
    lines += [_level(figures, name, width) for name in figures.levels]
    if figures.static.range_m is not None:
        lines += [_link_pdr(figures), Text(), *_fates(figures, inner)]
    if health or controls.real_time:
        lines += [Text(), _health(health, controls)]
    lines += [Text(), *_events(figures)]
    for line in lines:
        line.truncate(inner, overflow="ellipsis")
    seeds = figures.static.seeds
    arenas = f"seed {seeds[0]}" if len(seeds) == 1 else f"{len(seeds)} seeds, {seeds[0]} to {seeds[-1]}: means"
    title = Text.assemble((f"{figures.static.name}  ", "bold"), (arenas, "dim"))
    title.truncate(inner - 2, overflow="ellipsis")
    border = "yellow" if controls.paused else "cyan"
    return Frame(
        Group(*lines), title=title, title_align="left", subtitle=Text(FOOTER, "dim"), border_style=border, width=width
    )


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
        pace = f"real time x {speed:g}"
    else:
        pace = "as fast as possible" if speed is None else f"at most {speed:g} x real time"
    robots = (
        f"{figures.static.robots} robots" + (" in each arena" if figures.static.arenas > 1 else "") + figures.stopped
    )
    return Text.assemble(state, "   ", pace, "   ", (robots, "dim"))


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
        remaining_s = math.ceil((figures.duration_s - figures.time_s) / steady)
        hours = f"{remaining_s // 3600}:" if remaining_s >= 3600 else ""
        text += f" · {hours}{remaining_s // 60 % 60:02d}:{remaining_s % 60:02d} left"
    return Text(text)


def _level(figures: Figures, name: str, width: int) -> Text:
    per_value_s = 1 if width >= WIDE else 2
    history = figures.history(name, per_value_s)
    values, largest = HISTORY_S // per_value_s, 1.0
    if name == "components":
        largest = max((value for value in history if not math.isnan(value)), default=1.0)
    curve = sparkline(history[-values:], 0.0, largest)
    value = figures.level(name)
    text = f"{value:g}" if value.is_integer() and name == "components" else f"{value:.2f}"
    return _row(name.replace("_", " "), "-" if math.isnan(value) else text).append("  ").append(curve, "cyan")


def _link_pdr(figures: Figures) -> Text:
    line = _row("link PDR", _percent(figures.link_pdr_1s))
    return line.append("  in the last second, ", "dim").append(_percent(figures.link_pdr)).append(" in all", "dim")


def _fates(figures: Figures, width: int) -> list[Text]:
    """Return a bar with a part for each fate, and its legend in descending order of frequency."""
    total = int(figures.fates.sum())
    counts = [(name, int(count)) for name, count in zip(FATE_NAMES, figures.fates, strict=True) if count]
    bar = Text()
    start = 0
    for name, count in counts:  # the ends of parts are rounded, not their lengths, whose errors would add up
        bar.append("█" * ((start + count) * width // total - start * width // total), COLORS.get(name, "white"))
        start += count
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
        for count, name in (
            (health.lost, "lost"),
            (health.late_answers, "late answers"),
            (health.frames_dropped, "frames dropped"),
            (health.watchdog_stops, "stops"),
        ):
            line.append(f" · {count} {name}", "bold red" if count and name == "lost" else "yellow" if count else "dim")
    if controls.real_time:
        missed = controls.missed_ticks
        line.append(f"{' · ' if line else ''}{missed} ticks missed", "yellow" if missed else "dim")
    return line


def _events(figures: Figures) -> list[Text]:
    newest = [Text(event) for event in reversed(figures.events)]
    lines = newest or [Text("no events so far", "dim")]
    return lines + [Text()] * (MAX_EVENTS - len(lines))


def _row(label: str, value: str) -> Text:
    return Text(f"{label:<{LABEL}}").append(f"{value:>{VALUE}}", "bold")


def _percent(share: float) -> str:
    return "-" if math.isnan(share) else f"{share:.1%}"


def _plain(value: float) -> str:
    return f"{value:.1f}" if value < 100 else f"{value:.0f}"


BARS = "▁▂▃▄▅▆▇"  # without the full block, with which curves of adjacent lines would touch
GAP = " "


def sparkline(values: Sequence[float], least: float, largest: float) -> str:
    """Return a character per value, from the least to the largest; a gap for NaN.

    >>> sparkline([0.0, 0.5, 1.0, math.nan], 0.0, 1.0)
    '▁▄▇ '
    """
    span = largest - least
    return "".join(
        GAP if math.isnan(value) else BARS[_bar_index((value - least) / span if span > 0 else 0.0)] for value in values
    )


def _bar_index(share: float) -> int:
    return min(max(math.floor(share * len(BARS)), 0), len(BARS) - 1)

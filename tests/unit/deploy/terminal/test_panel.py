"""The panel fits the terminal, shows the run's figures, and is drawn seldom enough to cost nothing."""

import io
from typing import Self

import numpy as np
import pytest
from rich.cells import cell_len
from rich.console import Console

from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.observe.truth import EventRecord, Static
from swarmwire.comms.robot.packets import Fate
from swarmwire.deploy.cli.display.figures import Figures
from swarmwire.deploy.cli.display.panel import Panel, panel_view, sparkline
from swarmwire.deploy.runs.controls import Controls
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.world.backends.pacing import Pace
from swarmwire.world.backends.runner_reports import RunnerHealth
from tests.support.clocks import MS, FakeClock
from tests.support.metrics.truths import edges, poses, static, tally, truth

TICKS = 1000
HEALTH = RunnerHealth(ready=1000, lost=3, late_answers=123456, frames_dropped=7890, watchdog_stops=12)


def figures_of(run: Static, ticks: int, clock: FakeClock, tick_ms: int = 20) -> Figures:
    """The figures of a run whose packets meet every fate and whose events concern everybody."""
    metrics = Metrics(["order", "components", "largest_component"])
    figures = Figures(TICKS, metrics, clock)
    metrics.begin(run)
    figures.begin(run)
    counts = tally(*[{fate: 1 + int(fate) for fate in Fate}] * run.arenas)
    rows = run.arenas * run.robots
    for tick in range(ticks):
        event = EventRecord(0, 1.0, "blackout", bool(tick % 2), np.ones(rows, np.bool_))
        radio = {"tally": counts, "edges": edges((0, 1))} if run.range_m else {}
        moment = truth(run, tick, pose=poses([0.1 * tick * row for row in range(rows)]), events=(event,), **radio)
        metrics.see(moment)
        clock.time_ns += tick_ms * MS
        figures.see(moment)
    return figures


def shown(figures: Figures, controls: Controls, health: RunnerHealth | None, columns: int, rows: int) -> list[str]:
    console = Console(width=columns, height=rows, file=io.StringIO(), force_terminal=True, color_system=None)
    console.print(panel_view(figures, controls, health, columns))
    return console.file.getvalue().splitlines()


@pytest.mark.parametrize(
    ("columns", "rows", "radio", "arenas", "health", "factor"),
    [  # every two values of any two columns are together in a row
        (80, 24, True, 1, HEALTH, None),
        (80, 24, True, 8, None, 1.5),
        (80, 24, False, 1, None, 1.5),
        (80, 24, False, 8, HEALTH, None),
        (120, 40, True, 1, None, None),
        (120, 40, True, 8, HEALTH, 1.5),
        (120, 40, False, 1, HEALTH, 1.5),
        (120, 40, False, 8, None, None),
        (60, 24, True, 1, HEALTH, 1.5),
        (60, 24, True, 8, None, None),
        (60, 24, False, 1, None, None),
        (60, 24, False, 8, HEALTH, 1.5),
    ],
)
def test_panel_has_the_terminals_width_and_a_constant_height(columns, rows, radio, arenas, health, factor):
    clock = FakeClock()
    pace = None if factor is None else Pace(clock, 10, factor, lambda _: None)
    controls = Controls(clock, 10, pace)
    run = static(20, arenas, radio)
    heights = set()
    for ticks in (0, 1, 15, 100):
        figures = figures_of(run, ticks, clock)
        for ask in (controls.pause, controls.resume):
            lines = shown(figures, controls, health, columns, rows)
            assert {cell_len(line) for line in lines} == {columns}
            heights.add(len(lines))
            ask()
    assert len(heights) == 1
    assert max(heights) < rows


def test_panel_lines_that_are_too_long_are_cut_not_wrapped():
    clock = FakeClock()
    run = static(4)
    figures = figures_of(run, 20, clock)
    object.__setattr__(run, "name", "a name [bold]that has no end " * 9)
    lines = shown(figures, Controls(clock, 10), HEALTH, 60, 24)
    assert "[bold]" in lines[0]
    assert {cell_len(line) for line in lines} == {60}
    assert len(lines) == len(shown(figures, Controls(clock, 10), HEALTH, 200, 24))


def test_figures_are_those_of_the_last_second_and_of_the_whole_run():
    clock, run = FakeClock(), static(4)
    metrics = Metrics(["order", "components"])
    figures = Figures(TICKS, metrics, clock)
    metrics.begin(run)
    figures.begin(run)
    assert np.isnan([figures.link_pdr, figures.link_pdr_1s, figures.speed(1.0)]).all()
    for tick in range(40):
        fates = (
            {Fate.RECEIVED: 1, Fate.LOST: 3} if tick < 20 else {Fate.RECEIVED: 3, Fate.LOST: 1, Fate.OUT_OF_RANGE: 5}
        )
        moment = truth(run, tick, tally=tally(fates), edges=edges((0, 1), (1, 2)) if tick < 20 else edges())
        metrics.see(moment)
        clock.time_ns += (50 if tick < 20 else 200) * MS
        figures.see(moment)
    assert (figures.done, figures.time_s, figures.duration_s) == (40, 4.0, 100.0)
    assert (figures.link_pdr, figures.link_pdr_1s) == (0.5, 0.75)
    assert figures.fates[Fate.OUT_OF_RANGE] == 100
    assert (figures.level("components"), figures.history("components", 1)) == (4.0, [2.0, 2.0, 4.0, 4.0])
    assert figures.history("components", 3) == [pytest.approx(8 / 3), 4.0]
    assert figures.speed(1.0) == pytest.approx(0.5)
    assert figures.speed(10.0) == pytest.approx(4.0 / 5.0, rel=0.02)
    assert figures.levels == ("order", "components")


def test_arenas_that_have_stopped_are_told_once_there_are_any():
    figures = figures_of(run := static(2, arenas=3), 0, FakeClock())
    texts = []
    for running in ([1, 1, 1], [1, 0, 1], [0, 0, 1]):
        figures.see(truth(run, running=np.array(running, np.bool_)))
        texts.append(figures.stopped)
    assert texts == ["", ", 2 of 3 arenas running", ", 1 of 3 arenas running"]


def test_history_keeps_its_averages_as_the_minute_moves_on():
    clock, run = FakeClock(), static(4)
    figures = figures_of(run, 800, clock)
    before = figures.history("order", 2)
    after = figures_of(run, 820, clock).history("order", 2)
    assert len(before) == 30
    assert after[:29] == before[1:]


@pytest.mark.parametrize("tick_ms", [1, 20, 3000])
def test_speed_is_right_for_any_duration_of_a_tick(tick_ms):
    figures = figures_of(static(4), 900, FakeClock(), tick_ms)
    assert figures.speed(1.0) == pytest.approx(100 / tick_ms, rel=0.01)


def test_compiling_is_shown_until_the_tick_ends_and_counts_neither_as_speed_nor_as_time_left():
    clock, run, metrics, compiled_ns = FakeClock(), static(4), Metrics(["order"]), [5 * MS]
    figures = Figures(TICKS, metrics, clock, lambda: compiled_ns[0])
    metrics.begin(run)
    figures.begin(run)

    def tick(number: int, takes_ms: int) -> None:
        clock.time_ns += takes_ms * MS
        moment = truth(run, number)
        metrics.see(moment)
        figures.see(moment)

    controls = Controls(clock, 10)
    assert "running" in "".join(shown(figures, controls, None, 80, 24))
    compiled_ns[0] += 90_000 * MS
    clock.time_ns += 90_000 * MS
    state, _, time, *_ = shown(figures, controls, None, 80, 24)[1:]
    assert "compiling" in state
    assert "real time" not in time
    assert "left" not in time
    for number in range(20):
        tick(number, 50)
    assert "running" in "".join(shown(figures, controls, None, 80, 24))
    assert figures.speed(10.0) == pytest.approx(2.0, rel=0.1)  # 0.1 s in each 50 ms
    assert figures.compiled_s == pytest.approx(90.0)


def test_events_are_the_newest_three_and_name_a_few_robots():
    alone = figures_of(static(6), 5, FakeClock()).events
    assert list(alone) == [
        "0.2 s  blackout: flock-0, flock-1, flock-2, flock-3 and 2 more",
        "0.3 s  blackout ended: flock-0, flock-1, flock-2, flock-3 and 2 more",
        "0.4 s  blackout: flock-0, flock-1, flock-2, flock-3 and 2 more",
    ]
    assert figures_of(static(6, arenas=3), 1, FakeClock()).events[0] == "0.0 s  blackout: 18 robots"


@pytest.mark.parametrize(
    ("values", "expected"), [([], ""), ([0.0, 0.5, 1.0], "▁▄▇"), ([-5.0, 7.0], "▁▇"), ([float("nan"), 1.0], " ▇")]
)
def test_sparkline_has_a_character_per_value(values, expected):
    assert sparkline(values, 0.0, 1.0) == expected
    assert sparkline([1.0], 1.0, 1.0) == "▁"


class SlowFile(io.StringIO):
    """A terminal that takes some time for each picture, or is gone."""

    def __init__(self, clock: FakeClock, takes_ns: int) -> None:
        super().__init__()
        self.clock, self.takes_ns, self.gone, self.at_ns = clock, takes_ns, False, []

    def write(self, text: str) -> int:
        if self.gone:
            raise OSError("the terminal is gone")
        if "order" in text:
            self.at_ns.append(self.clock.time_ns)
            self.clock.time_ns += self.takes_ns
        return super().write(text)


class Drawn:
    """A panel of a run that a test lets tick, and its terminal."""

    def __init__(self, takes_ns: int) -> None:
        self.clock, self.static, self.metrics = FakeClock(), static(4), Metrics()
        self.file, self.controls = SlowFile(self.clock, takes_ns), Controls(self.clock, 10)
        console = Console(width=80, height=24, file=self.file, force_terminal=True)
        self.panel = Panel(TICKS, self.metrics, self.controls, lambda: None, self.clock, console)

    def __enter__(self) -> Self:
        self.metrics.begin(self.static)
        self.panel.begin(self.static)
        return self

    def __exit__(self, *_: object) -> None:
        self.file.gone = False
        self.panel.end(None)

    def tick(self, number: int = 0) -> None:
        moment = truth(self.static, number)
        self.metrics.see(moment)
        self.panel.see(moment)

    def wait(self, tick: int) -> None:
        """Let a second of wall time pass before this tick."""
        until_ns = self.clock.time_ns + NS_PER_S
        self.controls.wait(tick, lambda: self.clock.time_ns >= until_ns)


@pytest.mark.parametrize(("takes_ns", "most"), [(0, 10), (MS, 7), (3 * MS, 3)])
def test_panel_is_drawn_ten_times_a_second_at_most_and_takes_a_hundredth_of_the_run(takes_ns, most):
    with Drawn(takes_ns) as drawn:
        began_ns = drawn.clock.time_ns
        drawn.file.at_ns.clear()
        for tick in range(1000):
            drawn.clock.time_ns += 10 * MS
            drawn.tick(tick)
        pictures, took_ns = len(drawn.file.at_ns), drawn.clock.time_ns - began_ns
    assert 2 * took_ns / NS_PER_S - 1 <= pictures <= most * took_ns / NS_PER_S + 1
    assert pictures * takes_ns <= 0.01 * took_ns


def test_paused_run_is_still_drawn():
    with Drawn(0) as drawn:
        drawn.tick()
        drawn.controls.pause()
        before = len(drawn.file.at_ns)
        drawn.wait(1)
        assert 8 <= len(drawn.file.at_ns) - before <= 11
    assert "paused" in drawn.file.getvalue()


def test_terminal_lost_in_a_pause_raises_at_the_next_tick():
    with Drawn(0) as drawn:
        drawn.controls.pause()
        drawn.file.gone = True
        drawn.wait(0)
        with pytest.raises(OSError, match="the terminal is gone"):
            drawn.tick()

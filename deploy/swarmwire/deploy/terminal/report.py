"""The summary as people read it in a terminal."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table
from rich.text import Text

from swarmwire.comms.packets import Fate
from swarmwire.deploy.result import ArenaResult, Percentiles, Result, Statistics

if TYPE_CHECKING:
    from swarmwire.metrics.metric import Metric
    from swarmwire.world.backends.pacing import LatencySummary

BLOCKED = Fate.BLOCKED.name.lower()
SHOWN = 6  # arenas that are named, at most
SHOWN_S = 0.01  # that a run in real time took longer than asked for, at least: as the times above are rounded
WHOLE = 1000  # from here on numbers are shown without decimals, nor as powers of ten


def print_result(result: Result, metrics: "Iterable[Metric]", console: Console) -> None:
    """What came of a run: one table for the run, and its first arena's radio and what these metrics measured."""
    arena, of = result.arenas[0], {metric.name: metric for metric in metrics}
    table = Table(title=Text(result.scenario), show_header=False, title_justify="left", title_style="bold")
    table.add_column(style="cyan")
    table.add_column()
    who = f"{result.runners} processes, {result.mode}" if result.runners else _who(result)
    table.add_row(
        "robots", f"{result.robots}, {who}" + (f", {len(result.arenas)} arenas" if len(result.arenas) > 1 else "")
    )
    decimals = 2 if result.realtime else 1  # beside what was asked for, a percent counts
    speed = f"{result.sim_time_s:g} s in {result.wall_time_s:.2f} s: {result.realtime_factor:.{decimals}f} x real time"
    table.add_row("simulated", f"{speed} (start took {result.start_time_s:.2f} s), engine {result.engine}")
    if result.ended not in ("duration", "stopped"):
        table.add_row("ended", result.ended)
    _add_stops(table, result)
    if len(result.arenas) > 1:
        table.add_row("shown below", f"the arena of seed {arena.seed}")
    _add_radio(table, arena)
    for name, value in arena.metrics.items():
        if of[name].kind == "time":
            late = f"not in {arena.sim_time_s:g} s"
            table.add_row(name, late if value.final is None else f"at {_number(value.final)} s")
        elif value.mean is not None:
            table.add_row(name, _in_words(of[name], value))
    for body, sensors in result.global_sensors.items():
        table.add_row("global sensors", f"{body}: {', '.join(sensors)}")
    counts = [f"{name} {count}" for name, count in result.counts.items() if count]
    if counts:
        table.add_row("counts", ", ".join(counts))
    for loss in result.lost_runners:
        table.add_row("lost runner", loss)
    for change in result.runner_events:
        if change.what != "lost" and change.tick >= 0:
            table.add_row(f"{change.what} runner", str(change))
    _add_real_time(table, result)
    table.add_row("trajectory", f"{arena.trajectory_sha256[:16]}… (seed {arena.seed})")
    console.print(table)


def _who(result: Result) -> str:
    if not result.facts.gateways:
        return "all agents in this process"
    return "behind gateways: " + ", ".join(f"{group} ({kind})" for group, kind in result.facts.gateways.items())


def _add_stops(table: Table, result: Result) -> None:
    """Which arenas stopped, by what and since when it held, and which did not."""
    for condition in dict.fromkeys(result.stop):
        by = [arena for arena in result.arenas if arena.stopped_by == condition]
        if by:
            table.add_row(
                "stopped", f"{condition}: {_few([f'seed {of.seed} since {of.stop_time_s:g} s' for of in by])}"
            )
    rest = [f"seed {arena.seed}" for arena in result.arenas if arena.stopped_by is None]
    if result.stop and rest:
        table.add_row("not stopped", f"{_few(rest)} in {result.sim_time_s:g} s: {' or '.join(result.stop)}")


def _few(texts: Sequence[str]) -> str:
    more = len(texts) - SHOWN
    return ", ".join(texts[:SHOWN]) + (f" and {more} more" if more > 0 else "")


def _add_real_time(table: Table, result: Result) -> None:
    real = result.realtime
    if real is None:
        return
    missed = f"{real.missed_ticks} of {result.ticks} ticks missed"
    lag = f", worst lag {_lag(real.worst_lag_s)}" if real.missed_ticks else ""
    subticks = f" in subticks of {_lag(real.subtick_s)}" if real.subtick_s else ""
    table.add_row("real time", f"asked for x {real.factor:g}{subticks}{_longer(result, real.factor)}; {missed}{lag}")
    if real.tick_jitter:
        table.add_row("ticks began late", _delays(real.tick_jitter))
    if real.delivery:
        table.add_row("delivered late", f"{_delays(real.delivery)} of {real.delivery.count} packets")
    if result.runners:
        late, stops = sum(real.late_answers.values()), sum(real.watchdog_stops.values())
        drops = f"{real.frames_dropped} frames with {real.packets_dropped} packets dropped"
        table.add_row("runners", f"{late} late answers (per robot), {stops} watchdog stops, {drops}")


def _delays(of: "LatencySummary") -> str:
    """How late things came."""
    return f"{_lag(of.p50_s)} (99 %: {_lag(of.p99_s)}, worst {_lag(of.worst_s)})"


def _lag(lag_s: float) -> str:
    return f"{lag_s:.2f} s" if lag_s >= 1.0 else f"{lag_s * 1000:.1f} ms"


def _longer(result: Result, factor: float) -> str:
    """By how much it took longer than was asked for: behind gateways, where nobody changed the speed meanwhile."""
    longer_s = result.wall_time_s - result.sim_time_s / factor
    return f", took {_lag(longer_s)} longer" if result.facts.gateways and longer_s >= SHOWN_S else ""


def _add_radio(table: Table, arena: ArenaResult) -> None:
    radio = arena.radio
    if radio is None:
        return
    # Who has an obstacle in between is not in range, or a rock in the way would look like a bad radio.
    where = "in range and sight" if radio.fates[BLOCKED] else "in range"
    receivers = f"{radio.intended} intended receivers{_ratio('pdr', radio.pdr)}"
    table.add_row(
        "radio", f"{radio.sent} packets, {receivers}, {radio.in_range} {where}{_ratio('link_pdr', radio.link_pdr)}"
    )
    table.add_row("fates", ", ".join(f"{name} {count}" for name, count in radio.fates.items() if count))
    table.add_row(
        "latency", f"on air {_percentiles(radio.latency_air_s)}; to the agent {_percentiles(radio.latency_agent_s)}"
    )


def _ratio(name: str, ratio: float | None) -> str:
    return "" if ratio is None else f" ({name} {ratio:.1%})"


def _in_words(metric: "Metric", value: Statistics) -> str:
    """The numbers of a metric, with its unit: of one that counts the total, which stands for nothing else."""
    unit = f" ({metric.unit})" if metric.unit else ""
    if metric.kind == "count":
        return f"total {_number(value.final)}{unit}"
    return f"final {_number(value.final)}, mean {_number(value.mean)}, min {_number(value.min)}{unit}"


def _percentiles(value: Percentiles) -> str:
    if value.p50 is None or value.p99 is None:
        return "-"
    return f"{value.p50 * 1000:.0f} ms (99 %: {value.p99 * 1000:.0f} ms)"


def _number(value: float | None) -> str:
    if value is None:
        return "-"
    return f"{value:.0f}" if abs(value) >= WHOLE else f"{value:.3g}"

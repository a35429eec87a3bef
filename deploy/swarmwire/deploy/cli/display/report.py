"""The summary of a run in a terminal."""

from collections import Counter
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table
from rich.text import Text

from swarmwire.comms.base.printable import printable
from swarmwire.comms.robot.packets import Fate
from swarmwire.deploy.runs.result import ArenaResult, Percentiles, RadioResult, Result
from swarmwire.metrics.text import abbreviate, number_text
from swarmwire.world.interfaces.programs import ENDED

if TYPE_CHECKING:
    from swarmwire.metrics.measures.metric import Metric
    from swarmwire.world.backends.pacing import LatencySummary
    from swarmwire.world.motion.live import PosesReport

BLOCKED = Fate.BLOCKED.name.lower()
MAX_SHOWN = 6  # arenas in a line
MIN_DELAY_S = 0.01  # least delay of a run in real time that is printed: the rounding of times


def print_result(result: Result, metrics: "Iterable[Metric]", console: Console) -> None:
    """Print the summary of a run in groups: the run, and radio and metrics of its first arena."""
    arena = result.arenas[0]
    arena_text = f", arena of seed {arena.seed}" if len(result.arenas) > 1 else ""
    console.print(Text(printable(result.scenario), "bold"), soft_wrap=True)
    _print_group("run", _run_rows(result), console)
    if arena.radio is not None:
        _print_group(f"radio{arena_text}", _radio_rows(arena.radio), console)
    if arena.metrics:
        _print_metrics(f"metrics{arena_text}", arena, {metric.name: metric for metric in metrics}, console)


def _print_group(title: str, rows: Iterable[tuple[str, str]], console: Console) -> None:
    table = Table(box=None, show_header=False, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column(style="cyan", no_wrap=True)
    table.add_column()
    for name, value in rows:
        table.add_row(Text(f"  {name}"), Text(value))
    console.print(Text(title, "bold"), table, sep="\n")


def _print_metrics(title: str, arena: ArenaResult, metrics: "dict[str, Metric]", console: Console) -> None:
    """Print a row for each metric: final, mean, least and largest level, total count, or time."""
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="dim")
    table.add_column(Text("  "), style="cyan", no_wrap=True)
    for heading in ("final", "mean", "min", "max"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("unit", style="dim")
    for name, value in arena.metrics.items():
        metric = metrics[name]
        if metric.kind == "time" and value.final is None:
            table.add_row(f"  {name}", "never", "", "", "", f"within {arena.sim_time_s:g} s")
        elif metric.kind in ("count", "time"):
            table.add_row(f"  {name}", _number(value.final), "", "", "", _unit(metric))
        elif value.mean is not None:
            course = map(_number, (value.final, value.mean, value.min, value.max))
            table.add_row(f"  {name}", *course, _unit(metric))
    console.print(Text(title, "bold"), table, sep="\n")


def _unit(metric: "Metric") -> str:
    """Return the unit, and the meaning of a sum."""
    total = "in all" if metric.kind == "count" else ""
    return ", ".join(part for part in (metric.unit, total) if part)


def _run_rows(result: Result) -> Iterator[tuple[str, str]]:
    arena = result.arenas[0]
    executors = "runners" if any(event.what == "joined" for event in result.runner_events) else "processes"
    agents = f"{result.runners} {executors}, {result.mode}" if result.runners else _agents(result)
    yield "robots", f"{result.robots}, {agents}" + (f", {len(result.arenas)} arenas" if len(result.arenas) > 1 else "")
    decimals = 2 if result.realtime else 1  # a percent matters in real time
    speed = f"{result.sim_time_s:g} s in {result.wall_time_s:.2f} s: {result.realtime_factor:.{decimals}f} x real time"
    yield "simulated", f"{speed} (start took {result.start_time_s:.2f} s), engine {result.engine}"
    if result.ended not in ("duration", "stopped"):
        yield "ended", result.ended
    yield from _stop_rows(result)
    for body, sensors in result.global_sensors.items():
        yield "global sensors", f"{body}: {', '.join(sensors)}"
    counts = [f"{name} {count}" for name, count in result.counts.items() if count]
    if counts:
        yield "counts", ", ".join(counts)
    for loss in result.lost_runners:
        yield "lost runner", loss
    for change in result.runner_events:
        if change.what != "lost" and change.tick >= 0:
            yield f"{change.what} runner", str(change)
    yield from _real_time_rows(result)
    yield "trajectory", f"{arena.trajectory_sha256[:16]}… (seed {arena.seed})"


def _agents(result: Result) -> str:
    if not result.facts.gateways:
        return "all agents in this process"
    return "behind gateways: " + ", ".join(f"{group} ({kind})" for group, kind in result.facts.gateways.items())


def _stop_rows(result: Result) -> Iterator[tuple[str, str]]:
    """Return rows of arenas that stopped, by condition and with the time, and of the other arenas."""
    for condition in dict.fromkeys(result.stop):
        arenas = [arena for arena in result.arenas if arena.stopped_by == condition]
        if arenas:
            stops = [f"seed {arena.seed} since {arena.stop_time_s:g} s" for arena in arenas]
            yield "stopped", f"{condition}: {abbreviate(stops, MAX_SHOWN)}"
    unstopped = [f"seed {arena.seed}" for arena in result.arenas if arena.stopped_by is None]
    if result.stop and unstopped:
        yield (
            "not stopped",
            f"{abbreviate(unstopped, MAX_SHOWN)} in {result.sim_time_s:g} s: {' or '.join(result.stop)}",
        )


def _real_time_rows(result: Result) -> Iterator[tuple[str, str]]:
    real = result.realtime
    if real is None:
        return
    missed = f"{real.missed_ticks} of {result.ticks} ticks missed"
    lag = f", worst lag {_lag(real.worst_lag_s)}" if real.missed_ticks else ""
    subticks = f" in subticks of {_lag(real.subtick_s)}" if real.subtick_s else ""
    yield "real time", f"asked for x {real.factor:g}{subticks}{_longer(result, real.factor)}; {missed}{lag}"
    if real.tick_jitter:
        yield "ticks began late", _delays(real.tick_jitter)
    if real.delivery:
        yield "delivered late", f"{_delays(real.delivery)} of {real.delivery.count} packets"
    for poses in result.poses:
        yield "poses", f"{poses.received} from {poses.source}"
        if poses.use:
            yield "poses used late", _delays(poses.use)
        robot, gap_s = max(poses.longest_gap_s.items(), key=lambda pair: pair[1])
        yield "longest gap", f"{gap_s:.2f} s without a pose of {robot}{_silent(poses)}"
    if frames := result.interfaces:
        yield "interfaces", f"{frames.sent} frames sent, {frames.delivered} delivered, {frames.late} late"
        if frames.delivery:
            yield "frames late", _delays(frames.delivery)
        ends = Counter(event.part for event in result.events if event.do == ENDED)
        if ends:
            yield "programs ended", ", ".join(f"{count} with {how}" for how, count in ends.items())
    for topic in result.relay:
        received = f"{topic.messages} messages, {topic.received} of {topic.intended} received"
        yield f"topic {topic.topic}", f"{received}, {topic.sent_bytes} bytes in {topic.packets} packets"
    if result.runners:
        late, stops = sum(real.late_answers.values()), sum(real.watchdog_stops.values())
        drops = f"{real.frames_dropped} frames with {real.packets_dropped} packets dropped"
        yield "runners", f"{late} late answers (per robot), {stops} watchdog stops, {drops}"


def _silent(poses: "PosesReport") -> str:
    silent = [f"{robot} ({ticks} ticks)" for robot, ticks in poses.silent_ticks.items()]
    return f"; silent: {abbreviate(silent, MAX_SHOWN)}" if silent else ""


def _delays(latency: "LatencySummary") -> str:
    return f"{_lag(latency.p50_s)} (99 %: {_lag(latency.p99_s)}, worst {_lag(latency.worst_s)})"


def _lag(lag_s: float) -> str:
    return f"{lag_s:.2f} s" if lag_s >= 1.0 else f"{lag_s * 1000:.1f} ms"


def _longer(result: Result, factor: float) -> str:
    """Return the delay behind the requested speed, of runs with gateways: their speed cannot change."""
    longer_s = result.wall_time_s - result.sim_time_s / factor
    return f", took {_lag(longer_s)} longer" if result.facts.gateways and longer_s >= MIN_DELAY_S else ""


def _radio_rows(radio: RadioResult) -> Iterator[tuple[str, str]]:
    # Robots behind an obstacle do not count as in range, since a rock would look like a bad radio.
    reach = "in range and sight" if radio.fates[BLOCKED] else "in range"
    yield "packets", f"{radio.sent} sent, {radio.intended} intended receivers, {radio.in_range} {reach}"
    if radio.pdr is not None:
        yield "pdr", f"{radio.pdr:.1%} (received / intended)"
    if radio.link_pdr is not None:
        yield "link_pdr", f"{radio.link_pdr:.1%} (received / in range)"
    yield "fates", ", ".join(f"{name} {count}" for name, count in radio.fates.items() if count)
    yield "latency", f"on air {_percentiles(radio.latency_air_s)}; to the agent {_percentiles(radio.latency_agent_s)}"


def _percentiles(value: Percentiles) -> str:
    if value.p50 is None or value.p99 is None:
        return "-"
    p50_ms, p99_ms = (number_text(round(delay_s * 1000.0, 3)) for delay_s in (value.p50, value.p99))
    return f"{p50_ms} ms (99 %: {p99_ms} ms)"


def _number(value: float | None) -> str:
    return "-" if value is None else number_text(value)

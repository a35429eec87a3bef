"""The sections on the radio (fates, delivery over distance, latencies) and on real time (lateness, gaps of poses)."""

import shlex
from typing import Any

import numpy as np
import polars as pl

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.ethernet import LATE_S
from swarmwire.comms.observe.truth import Static
from swarmwire.comms.robot.packets import FATE_NAMES, Fate
from swarmwire.metrics.measures.network.latency import PERCENTS, acts_at_ns
from swarmwire.metrics.pictures.drawing.canvas import CURVE, INK, LINK, SMALL_PT, SOFT, plain_axes
from swarmwire.metrics.pictures.drawing.radio import draw_intended, draw_ratio, received_bins
from swarmwire.metrics.pictures.report.page import (
    COLUMN_IN,
    Figure,
    Listing,
    Part,
    ReportSection,
    ReportTable,
    blank_figure,
    drawn_figure,
)
from swarmwire.metrics.pictures.report.run_data import RunData
from swarmwire.metrics.pictures.report.run_links import links
from swarmwire.metrics.text import counted, number, share, short

_LATENCIES = {"latency_air_s": "on air", "latency_agent_s": "to the agent"}
_HEIGHT_IN = 2.75
_BINS = 48
_LOG_RATIO = 30.0  # ratio of the longest to the shortest latency above which the axis is logarithmic
_LAST_PERCENT = 99.9  # percentile at the end of the axis, since a single packet may be very late
_DASHES = ((0, ()), (0, (4, 2)), (0, (1.2, 1.6)))
COLUMNS = ("receiver", "fate", "sent_at_ns", "final_at_ns")
_MAX_ROBOTS = 12  # larger tables of robots are folded
_LATE_CAPTION = (
    "Lateness in wall time: of ticks behind their planned start, of deliveries behind the reception by the radio."
)


def _tables(run: RunData) -> list[Part]:
    """Return the tables of fates and latencies from the summary; without a summary a sentence."""
    if run.summary is None:
        return ["Fates of packets are counted at the end of a run; this run has not ended."]
    totals: list[dict[str, Any] | None] = [run.of_arena("radio", arena) for arena in range(run.static.arenas)]
    arenas = [total for total in totals if total]
    if not arenas:
        return []
    return [_fates(arenas), _latencies(arenas[0], len(arenas))]


def _fates(arenas: list[dict[str, Any]]) -> ReportTable:
    intended = sum(arena["intended"] for arena in arenas)
    totals = {fate: sum(arena["fates"].get(fate.name.lower(), 0) for arena in arenas) for fate in Fate}
    rows = tuple(
        (fate.name.lower().replace("_", " "), f"{packets:,}", share(packets / intended), fate.meaning)
        for fate, packets in totals.items()
        if packets
    )
    together = f" in {len(arenas)} arenas together" if len(arenas) > 1 else ""
    caption = f"Fates of packets{together}, one per intended receiver; they add up to {intended:,}."
    return ReportTable(("fate", "receivers", "share", "meaning"), rows, caption)


def _latencies(radio: dict[str, Any], arenas: int) -> ReportTable:
    percents = tuple(f"p{percent:g}" for percent in PERCENTS)
    rows = tuple(
        (name, *(_ms(radio[key][percent]) for percent in percents)) for key, name in _LATENCIES.items() if key in radio
    )
    note = ", of the first arena" if arenas > 1 else ""
    return ReportTable(
        ("latency", *(f"{percent} in ms" for percent in percents)), rows, f"Latencies of all packets received{note}."
    )


def _ms(value_s: float | None) -> str:
    return number(None if value_s is None else 1e3 * value_s)


def distances(run: RunData) -> Figure | str:
    """Return the figure of delivery over distance, or the reason for its absence."""
    table = run.table("radio_distances")
    if isinstance(table, str):
        killed = " It is written at the end of a run." if run.summary is None else ""
        return f"Delivery over distance: {table}{killed}"
    shown = received_bins(table)
    if not len(shown):
        return "Delivery over distance: no packet was transmitted."
    caption = (
        "pdr (received / intended) over distance: the share of intended receivers that received, for packets on air. "
        "Bars are 95 % intervals (Wilson), with receivers assumed independent."
    )
    every = run.record("radio_distances").get("every", 1)
    if every > 1:
        caption += f" One of {every} packets was counted."
    figure = delivery_by_distance(shown, run.static.range_m)
    return drawn_figure("delivery-by-distance", figure, caption)


def delivery_by_distance(table: pl.DataFrame, range_m: float | None) -> Any:
    """Draw at least one row of an arena's `radio_distances`."""
    figure = blank_figure(COLUMN_IN, _HEIGHT_IN)
    upper = plain_axes(figure, (0.11, 0.5, 0.86, 0.41), "share of the receivers that received")
    lower = plain_axes(figure, (0.11, 0.14, 0.86, 0.2), "receivers that packets were meant for")
    draw_ratio(upper, table, range_m)
    draw_intended(lower, table)
    upper.tick_params(labelbottom=False)
    lower.yaxis.set_major_formatter(short)
    return figure


def latency_histogram(air_s: FloatArray, agent_s: FloatArray) -> Any:
    """Draw histograms of latencies on air (k,) and to the agent (k,), k > 0."""
    figure = blank_figure(COLUMN_IN, _HEIGHT_IN)
    edges_ms = _edges(1e3 * np.concatenate([air_s, agent_s]))
    _draw(figure, 0.575, "on air", 1e3 * air_s, edges_ms, CURVE).tick_params(labelbottom=False)
    lower = _draw(figure, 0.14, "to the agent", 1e3 * agent_s, edges_ms, LINK)
    lower.set_xlabel("from sending in ms", fontsize=SMALL_PT, color=SOFT, labelpad=2)
    return figure


def _draw(figure: Any, foot: float, name: str, latency_ms: FloatArray, edges_ms: FloatArray, color: str) -> Any:
    percentiles_ms = percentiles(latency_ms)
    percents = ", ".join(f"p{p:g} {number(ms)}" for p, ms in zip(PERCENTS, percentiles_ms, strict=True))
    axes = plain_axes(figure, (0.11, foot, 0.86, 0.325), f"{name}: {percents} ms")
    counts = np.histogram(np.clip(latency_ms, edges_ms[0], edges_ms[-1]), edges_ms)[0]
    axes.stairs(100.0 * counts / len(latency_ms), edges_ms, fill=True, color=color, alpha=0.75)
    if edges_ms[0] > 0.0:
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter("")
    axes.set_xlim(edges_ms[0], edges_ms[-1])
    for ms, dashes in zip(percentiles_ms, _DASHES, strict=True):
        axes.axvline(ms, color=INK, lw=0.8, ls=dashes)
    axes.locator_params(axis="y", nbins=3)
    axes.set_ylabel("% of receivers", fontsize=SMALL_PT, color=SOFT, labelpad=1)
    return axes


def receivers_act_at_ns(final_at_ns: IntArray, receiver: IntArray, static: Static) -> IntArray:
    """Return the times (k,) in ns at which the receivers (k,) of packets received at times (k,) act next."""
    tick = -(-final_at_ns * static.rate_hz // NS_PER_S)
    return acts_at_ns(tick, static.act_every_ticks[receiver], static.rate_hz)


def percentiles(latency: FloatArray) -> list[float]:
    """Return p50, p90 and p99 by the nearest rank, equal to the summary's."""
    return np.percentile(latency, PERCENTS, method="inverted_cdf").tolist()


def _edges(latency_ms: FloatArray) -> FloatArray:
    """Return edges of bins of equal widths from 0 on, or of equal ratios for a wide range of latencies."""
    low, high = float(latency_ms.min()), float(np.percentile(latency_ms, _LAST_PERCENT))
    if low > 0.0 and high > _LOG_RATIO * low:
        return np.geomspace(low, high, _BINS + 1)
    return np.linspace(0.0, max(1.05 * high, 1e-3), _BINS + 1)


def latencies(run: RunData) -> Figure | str:
    """Return the histograms of latencies, or the reason for their absence."""
    packets = run.packets(COLUMNS)
    if isinstance(packets, str):
        return f"Latencies of single packets: {packets}"
    received = packets.filter(packets["fate"].cast(str) == FATE_NAMES[Fate.RECEIVED])
    if not len(received):
        return "Latencies: no packet was received."
    receiver, _, sent_ns, final_ns = (received[name] for name in COLUMNS)
    sent = sent_ns.to_numpy()
    final = final_ns.to_numpy()
    acts = receivers_act_at_ns(final, receiver.to_numpy(), run.static)
    figure = latency_histogram((final - sent) / NS_PER_S, (acts - sent) / NS_PER_S)
    caption = (
        "Latency of received packets: from sending to reception, and to the first tick at which the receiver acts. "
        "Lines are p50, p90 (dashed) and p99 (dotted)."
    )
    recorded = run.record("packets").get("share", 1.0)
    if recorded < 1.0:
        caption += f" A share of {recorded:g} of the packets was recorded."
    return drawn_figure("latency", figure, caption)


FIGURES = distances, latencies, links  # each returns a figure, or the reason for its absence


def _radio_parts(run: RunData) -> list[Part]:
    """Return figures side by side, the reasons for missing ones, and tables."""
    if not run.has_radio:
        return ["The robots have no radio."]
    totals = run.of_arena("radio")
    account = [_account(totals, run.static.arenas)] if totals else []
    drawn = [draw(run) for draw in FIGURES]
    figures = [part for part in drawn if isinstance(part, Figure)]
    missing: list[Part] = [part for part in drawn if isinstance(part, str)]
    needed = run.table("radio_distances"), run.packets(("fate",))
    if missing and run.started and any(isinstance(table, str) for table in needed):
        folder = shlex.quote(f"{run.folder.path.resolve().name}-again")
        missing.append("A repetition of the same run records the missing tables:")
        missing.append(Listing(f"swarmwire repeat {run.shown_name} --packets all --links --out {folder}"))
    return [*account, *figures, *missing, *_tables(run)]


RADIO = ReportSection("The radio", _radio_parts)


def _account(radio: dict[str, Any], arenas: int) -> str:
    sent, intended, in_range = radio["sent"], radio["intended"], radio["in_range"]
    prefix = "In the first arena " if arenas > 1 else ""
    pdr = _ratio("pdr = received / intended", radio["pdr"])
    link_pdr = _ratio("link_pdr = received / in range", radio["link_pdr"])
    receivers = f"{intended:,} intended receivers{pdr}, of which {in_range:,} were in range{link_pdr}"
    return f"{prefix}{sent:,} packets were sent to {receivers}."


def _ratio(name: str, ratio: float | None) -> str:
    return "" if ratio is None else f" ({name} = {share(ratio)})"


def _real_time_parts(run: RunData) -> list[Part]:
    """Return the lateness of ticks, packets and frames, the gaps of poses from outside, and the relayed topics.

    Nothing for a run in lockstep, or without a summary.
    """
    pace: dict[str, Any] | None = run.summary and run.summary["realtime"]
    if not run.summary or not pace:
        return []
    frames: dict[str, Any] | None = run.summary["interfaces"]
    delays = {
        "ticks": pace["tick_jitter"],
        "packets to agents": pace["delivery"],
        "frames to interfaces": frames and frames["delivery"],
    }
    rows = tuple((name, *_delay_cells(delay)) for name, delay in delays.items() if delay)
    columns = ("what", "count", "p50 in ms", "p99 in ms", "worst in ms")
    table = [ReportTable(columns, rows, _LATE_CAPTION)] if rows else []
    poses = [_poses(source) for source in run.summary["poses"]]
    relayed = [_relayed(topic) for topic in run.summary["relay"]]
    return [_pace(pace, run.summary["ticks"]), *table, *([_frames(frames)] if frames else []), *poses, *relayed]


REAL_TIME = ReportSection("Real time", _real_time_parts)


def _pace(pace: dict[str, Any], ticks: int) -> str:
    missed = pace["missed_ticks"]
    lag = f", at worst by {number(1e3 * pace['worst_lag_s'])} ms" if missed else ""
    subtick = f" in sub-ticks of {number(1e3 * pace['subtick_s'])} ms" if pace["subtick_s"] else ""
    return f"Target: {number(pace['factor'])} × real time{subtick}; {missed:,} of {counted(ticks, 'tick')} missed{lag}."


def _frames(frames: dict[str, Any]) -> str:
    sent = f"{counted(frames['sent'], 'frame')} ({frames['sent_bytes']:,} bytes)"
    delivered = f"{frames['delivered']:,} ({frames['delivered_bytes']:,} bytes)"
    late = f"{frames['late']:,} of them ({share(frames['late'] / max(frames['delivered'], 1))})"
    return (
        f"Programs sent {sent} through their robots' interfaces; {delivered} were delivered, one per receiver, "
        f"{late} more than {1e3 * LATE_S:g} ms late."
    )


def _poses(source: dict[str, Any]) -> ReportTable:
    """Return a row per robot of a live source of poses, the longest gap first."""
    gaps_s: dict[str, float] = source["longest_gap_s"]
    silent: dict[str, int] = source["silent_ticks"]
    rows = tuple(
        (robot, number(gap_s), f"{silent.get(robot, 0):,}")
        for robot, gap_s in sorted(gaps_s.items(), key=lambda pair: -pair[1])
    )
    caption = (
        f"Poses from {source['source']}: {source['received']:,} were used{_after(source['use'])}. "
        "The gap is the greatest age of a robot's newest pose at a tick, in wall time; silent are ticks at which it "
        "was older than `max_age_s`."
    )
    return ReportTable(("robot", "longest gap in s", "silent ticks"), rows, caption, folded=len(rows) > _MAX_ROBOTS)


def _after(use: dict[str, Any] | None) -> str:
    return f", 99 % of them within {number(1e3 * use['p99_s'])} ms of their arrival" if use else ""


def _relayed(topic: dict[str, Any]) -> ReportTable:
    """Return a row per robot of a topic of ROS 2 that crossed the radio, with a row of totals."""
    numbers = ("messages", "received", "packets", "sent_bytes")
    robots: dict[str, dict[str, int]] = {**topic["robots"], "all": topic}
    rows = tuple((name, *(f"{counts[key]:,}" for key in numbers)) for name, counts in robots.items())
    kind = f"reliable, {topic['repeated']:,} parts repeated on request" if topic["reliable"] else "best effort"
    caption = (
        f"Topic {topic['topic']} over the radio ({kind}): of {topic['intended']:,} intended receptions "
        f"{topic['lost']:,} were lost. Messages are the robot's, received those of others. Packets and bytes are the "
        "payloads that its radio was to send, requests included."
    )
    columns = ("robot", *numbers[:-1], "bytes")
    return ReportTable(columns, rows, caption, folded=len(rows) > _MAX_ROBOTS)


def _delay_cells(delay: dict[str, Any]) -> tuple[str, ...]:
    return (f"{delay['count']:,}", *(number(1e3 * delay[key]) for key in ("p50_s", "p99_s", "worst_s")))

"""The section on real time: how late ticks began, and packets and frames of interfaces were delivered."""

from typing import Any

from swarmwire.comms.ethernet import LATE_S
from swarmwire.metrics.report.page import Section, Table
from swarmwire.metrics.report.run_data import RunData
from swarmwire.metrics.text import counted, number, share

_CAPTION = (
    "Lateness in wall time: of ticks behind their planned start, of deliveries behind the reception by the radio."
)


def real_time(run: RunData) -> list[Section]:
    """The section; nothing for a run in lockstep, or without a summary."""
    pace: dict[str, Any] | None = run.summary and run.summary["realtime"]
    if not run.summary or not pace:
        return []
    frames: dict[str, Any] | None = run.summary["interfaces"]
    late = {
        "ticks": pace["tick_jitter"],
        "packets to agents": pace["delivery"],
        "frames to interfaces": frames and frames["delivery"],
    }
    rows = tuple((name, *_delays(of)) for name, of in late.items() if of)
    head = ("what", "count", "p50 in ms", "p99 in ms", "worst in ms")
    parts = (_pace(pace, run.summary["ticks"]), *([Table(head, rows, _CAPTION)] if rows else []))
    return [Section("Real time", (*parts, *([_frames(frames)] if frames else [])))]


def _pace(pace: dict[str, Any], ticks: int) -> str:
    missed = pace["missed_ticks"]
    lag = f", at worst by {number(1e3 * pace['worst_lag_s'])} ms" if missed else ""
    subtick = f" in sub-ticks of {number(1e3 * pace['subtick_s'])} ms" if pace["subtick_s"] else ""
    return (
        f"Asked for {number(pace['factor'])} × real time{subtick}; {missed:,} of {counted(ticks, 'tick')} missed{lag}."
    )


def _frames(frames: dict[str, Any]) -> str:
    sent = f"{counted(frames['sent'], 'frame')} ({frames['sent_bytes']:,} bytes)"
    delivered = f"{frames['delivered']:,} ({frames['delivered_bytes']:,} bytes)"
    late = f"{frames['late']:,} of them ({share(frames['late'] / max(frames['delivered'], 1))})"
    return (
        f"Programs sent {sent} through their robots' interfaces; {delivered} were delivered, one for each receiver, "
        f"{late} more than {1e3 * LATE_S:g} ms late."
    )


def _delays(of: dict[str, Any]) -> tuple[str, ...]:
    return (f"{of['count']:,}", *(number(1e3 * of[key]) for key in ("p50_s", "p99_s", "worst_s")))

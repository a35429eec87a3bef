"""Run folders of a few ticks, with a summary or as a killed run leaves them."""

import json
from pathlib import Path
from typing import Any

from swarmwire.metrics.event_log import EventLog
from swarmwire.metrics.metrics import Metrics
from swarmwire.metrics.network.radio_tally import RadioTally
from tests.support.metrics.recorded import record


def run_folder(folder: Path, of, ticks, ended="duration", summary=True, **options) -> Path:
    """Record these ticks; with a summary as a run writes it, as far as reports read it."""
    seen = list(ticks)
    tables = record(folder, of, seen, **options)
    (folder / "run.json").write_text(json.dumps({"format": 1, "ticks": 50, "cpu": "a CPU", "versions": {"numpy": "2"}}))
    (folder / "scenario.toml").write_text(f"format = 1\nname = '{of.name}'\n")
    if summary:
        told = {**_observed(of, seen), **_about(of, seen, ended), "record": tables}
        (folder / "summary.json").write_text(json.dumps(told))
    return folder


def _observed(of, seen):
    parts: dict[str, Any] = {"radio": None}
    for observer in (Metrics(), RadioTally(), EventLog()):
        observer.begin(of)
        for one in seen:
            observer.see(one)
        parts.update(observer.end(None))
    if of.arenas == 1:
        parts["metrics"] = parts["metrics"][0]
        parts["radio"] = parts["radio"][0] if parts["radio"] else None
    return parts


def _about(of, seen, ended):
    return {
        "format": 1,
        "scenario": of.name,
        "arenas": of.arenas,
        "ended": ended,
        "ticks": len(seen),
        "sim_time_s": len(seen) / of.rate_hz,
        "wall_time_s": 0.5,
        "realtime_factor": 2.0,
        "trajectory_sha256": [f"{arena:064x}" for arena in range(of.arenas)],
        "engine": "discs",
        "mode": "local",
        "runners": 0,
        "counts": {"clipped_commands": 3, "nan_commands": 0},
        "cpu": "a CPU",
        "versions": {"numpy": "2"},
    }

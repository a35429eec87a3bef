"""Run folders of a few ticks, with a summary or as a killed run leaves them."""

import json
from pathlib import Path
from typing import Any

from swarmwire.metrics.measure import Metrics
from swarmwire.metrics.network.radio_tally import RadioTally
from swarmwire.metrics.run_folder.events import EventLog
from tests.support.metrics.recorded import record
from tests.support.metrics.summaries import made_up_summary
from tests.support.metrics.truths import watch


def run_folder(folder: Path, of, ticks, ended="duration", summary=True, **options) -> Path:
    """Record these ticks; with a summary as a run writes it, as far as reports read it."""
    seen = list(ticks)
    tables = record(folder, of, seen, **options)
    (folder / "run.json").write_text(json.dumps({"format": 1, "ticks": 50, "cpu": "a CPU", "versions": {"numpy": "2"}}))
    (folder / "scenario.toml").write_text(f"format = 1\nname = '{of.name}'\n")
    if summary:
        counts = {"clipped_commands": 3, "nan_commands": 0}
        told = made_up_summary(
            len(seen),
            arenas=of.arenas,
            rate_hz=of.rate_hz,
            **_observed(of, seen),
            ended=ended,
            counts=counts,
            record=tables,
        )
        (folder / "summary.json").write_text(json.dumps(told))
    return folder


def _observed(of, seen):
    parts: dict[str, Any] = {"radio": None}
    for observer in (Metrics(), RadioTally(), EventLog()):
        watch(of, seen, observer)
        parts.update(observer.end(None))
    if of.arenas == 1:
        parts["metrics"] = parts["metrics"][0]
        parts["radio"] = parts["radio"][0] if parts["radio"] else None
    return parts

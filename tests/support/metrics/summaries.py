"""The content of `summary.json` of made-up runs."""

from typing import Any


def made_up_summary(ticks: int, *, arenas: int = 1, rate_hz: int = 10, **given: Any) -> dict[str, Any]:
    """All that a summary holds, of a run that ended with its duration and measured nothing; `given` in place of it."""
    sim_time_s = ticks / rate_hz
    end = {"ended": "duration", "ticks": ticks, "sim_time_s": sim_time_s, "stop_time_s": None, "stopped_by": None}
    return {
        "format": 1,
        "scenario": "made-up",
        "arenas": arenas,
        "engine": "discs",
        "runners": 0,
        "mode": "local",
        "ended": "duration",
        "error": None,
        "ticks": ticks,
        "sim_time_s": sim_time_s,
        "wall_time_s": 0.5,
        "realtime_factor": 2.0,
        "stop": [],
        "by_arena": [{**end, "counts": {}}] * arenas,
        "trajectory_sha256": [f"{arena:064x}" for arena in range(arenas)],
        "radio": None if arenas == 1 else [None] * arenas,
        "metrics": {} if arenas == 1 else [{}] * arenas,
        "events": [],
        "global_sensors": {},
        "counts": {},
        "lost_runners": [],
        "runner_events": [],
        "record": {},
        "cpu": "a CPU",
        "versions": {"numpy": "2"},
        "files": [],
        "inputs": None,
        "live_events": None,
        **given,
    }

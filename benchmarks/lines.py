"""What benchmarks print: one JSON object a line, with the whole configuration."""

import json
from typing import Any

from benchmarks.targets import TARGETS
from swarmwire.deploy import Result
from swarmwire.deploy.runs.record.provenance import cpu


def report(name: str, value: float, unit: str, result: Result, config: dict[str, Any]) -> None:
    """Print one line about a run."""
    radio = result.radio
    arenas = {"arenas": len(result.arenas)} if len(result.arenas) > 1 else {}
    details = {
        "robots": result.robots,
        **arenas,
        "runners": result.runners,
        "ticks": result.ticks,
        "rate_hz": 10,
        **config,
        "packets_received_per_robot_tick": round(radio.fates["received"] / result.robots / result.ticks, 2)
        if radio
        else 0,
        "collisions": sum(arena.metrics["collisions"].final or 0.0 for arena in result.arenas),
        "wall_contacts": sum(arena.metrics["wall_contacts"].final or 0.0 for arena in result.arenas),
    }
    print_line(name, value, unit, details)


def print_line(name: str, value: float, unit: str, details: dict[str, Any]) -> None:
    """Print a value, its target, and all that it was measured under."""
    target = TARGETS.get(name)
    target_fields = (
        {"at_most" if target.at_most else "at_least": target.value, "met": target.met_by(value)} if target else {}
    )
    line = {"name": name, "value": round(value, 3), "unit": unit, **target_fields, **details, "cpu": cpu()}
    print(json.dumps(line), flush=True)


def spread(values: list[float]) -> dict[str, float]:
    """Lowest and highest of the repeats."""
    return {"lowest": round(min(values), 3), "highest": round(max(values), 3)}

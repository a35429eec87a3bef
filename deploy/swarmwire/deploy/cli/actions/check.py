"""`swarmwire check` and `schema`: scenarios without a run."""

import json
from collections.abc import Sequence
from pathlib import Path

from swarmwire.deploy.runs.config import RunConfig
from swarmwire.deploy.runs.plan import make_plan
from swarmwire.deploy.terminal.output import echo
from swarmwire.world.placement.maps import layout_hints
from swarmwire.world.scenario_file import load_scenario, scenario_schema


def check_scenario(path: Path, overrides: Sequence[str]) -> None:
    """Check a scenario, and print its groups, duration and engines, and events that come too late."""
    scenario = load_scenario(path, overrides)
    plan, world = make_plan(RunConfig(scenario))
    static, engines = plan.static, " and ".join(world.engines)
    groups = ", ".join(f"{group.stop - group.start} x {group.body.name} ({group.name})" for group in static.groups)
    last_s = (plan.ticks - 1) / static.rate_hz  # start of the last tick
    late = [f"events.{number}" for number, event in enumerate(scenario.events) if event.at_s > last_s]
    too_late = f"; too late to happen: {', '.join(late)}" if late else ""
    length = f"{scenario.duration_s:g} s at {static.rate_hz} Hz"
    echo(f"OK {path}: {groups}, {length}, engine {engines}{too_late}")
    for hint in layout_hints(scenario.arena, scenario.source):
        echo(f"hint: {hint}")


def print_schema() -> None:
    """Print the JSON schema of scenarios."""
    echo(json.dumps(scenario_schema(), indent=2))

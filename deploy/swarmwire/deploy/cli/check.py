"""`swarmwire check`."""

import typer

from swarmwire.deploy.cli.options import Overrides, ScenarioFile


def check_command(scenario: ScenarioFile, overrides: Overrides = None) -> None:
    """Check a scenario without running it: keys, values, agents, what they need, and room for everything."""
    from swarmwire.deploy.simulation import Simulation
    from swarmwire.world.scenario_file import load_scenario

    checked = load_scenario(scenario, overrides or [])
    simulation = Simulation(checked)
    static, engines = simulation.static, " and ".join(simulation.world.engines)
    groups = ", ".join(f"{group.stop - group.start} {group.body.name} ({group.name})" for group in static.groups)
    last_s = (simulation.ticks - 1) / static.rate_hz  # start of the last tick
    late = [f"events.{place}" for place, event in enumerate(checked.events) if event.at_s > last_s]
    too_late = f"; too late to happen: {', '.join(late)}" if late else ""
    length = f"{checked.duration_s:g} s at {static.rate_hz} Hz"
    typer.echo(f"{scenario}: good: {groups}, {length}, engine {engines}{too_late}")

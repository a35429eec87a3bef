"""`swarmwire check`."""

import typer

from swarmwire.deploy.commands.options import Overrides, ScenarioFile


def check_command(scenario: ScenarioFile, overrides: Overrides = None) -> None:
    """Check a scenario without running it: keys, values, agents, what they need, and room for everything."""
    from swarmwire.deploy.simulation import Simulation
    from swarmwire.world.scenario.scenario_file import load_scenario

    checked = load_scenario(scenario, overrides or [])
    simulation = Simulation(checked)
    static, engines = simulation.static, " and ".join(simulation.world.engines)
    groups = ", ".join(f"{group.stop - group.start} {group.body.name} ({group.name})" for group in static.groups)
    typer.echo(f"{scenario}: good: {groups}, {checked.duration_s:g} s at {static.rate_hz} Hz, engine {engines}")

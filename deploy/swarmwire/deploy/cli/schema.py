"""`swarmwire schema`."""

import json

import typer


def schema_command() -> None:
    """Print the JSON schema of a scenario, for editors and programs."""
    from swarmwire.world.scenario_file import scenario_schema

    typer.echo(json.dumps(scenario_schema(), indent=2))

"""`swarmwire join`: agents of robots in a run of another process or machine."""

import typer

from swarmwire.agent.join_command import join_and_report, parse_names
from swarmwire.agent.joining import JoinSettings
from swarmwire.deploy.cli.world import JoinCommandOptions
from swarmwire.deploy.robots.certificates.member import member
from swarmwire.deploy.robots.certificates.register import RUNNER


def join_world(options: JoinCommandOptions) -> None:
    """Run agents until the run ends, or Ctrl-C."""
    certificate = options.name if options.certs else None
    credentials = member(RUNNER, certs=options.certs, name=certificate, insecure=options.insecure)
    credentials.check("ENDPOINT", options.endpoint)
    settings = JoinSettings(
        endpoint=options.endpoint,
        robots=options.robots,
        names=None if options.names is None else parse_names(options.names),
        agents=tuple(options.agents or ()),
        scenario=options.scenario,
        name=options.name,
        run=options.run,
        network=credentials.network,
    )
    code = join_and_report(settings, options.processes, agent_network=options.agent_network, isolate=options.isolate)
    if code:
        raise typer.Exit(code)

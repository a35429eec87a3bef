"""`swarmwire join`."""

from pathlib import Path
from typing import Annotated

import typer

from swarmwire.deploy.cli.options import Ca, Certificate, Certs, Insecure, Key


def join_command(
    endpoint: Annotated[
        str, typer.Argument(help="Where the world, or a router before it, listens: tls/10.0.0.5:7447.")
    ],
    robots: Annotated[
        int | None,
        typer.Option(help="So many robots, the next that are free. Default: all that are free, or the next part."),
    ] = None,
    names: Annotated[str | None, typer.Option(help="These robots: flock-0,flock-3.", metavar="NAME,…")] = None,
    agents: Annotated[
        list[str] | None,
        typer.Option(
            "--agent",
            help="The agent, of all groups or of one: mine.py:Mine. Default: as the scenario names it. Repeatable.",
            metavar="[GROUP=]AGENT",
        ),
    ] = None,
    scenario: Annotated[
        Path | None, typer.Option(help="Join only a run of exactly this scenario.", metavar="FILE")
    ] = None,
    name: Annotated[
        str | None,
        typer.Option(help="The runner's name. Default: that of its certificate, or one made up.", metavar="NAME"),
    ] = None,
    run: Annotated[str | None, typer.Option(help="Which run, if there are several.", metavar="ID")] = None,
    certs: Certs = None,
    ca: Ca = None,
    certificate: Certificate = None,
    key: Key = None,
    insecure: Insecure = False,
) -> None:
    """Play robots of a run that a world elsewhere has opened with swarmwire world.

    The agent is the one that is installed here; its file must be the same as the world's: code is never sent. Ctrl-C
    leaves the run. On a machine that has the agents' package alone it is swarmwire-agent join. For example:

      swarmwire join tls/10.0.0.5:7447 --robots 5 --certs lab-certs --name r1
    """
    # Imported here: zenoh takes a moment, which --help and typing errors should not.
    from swarmwire.agent.join_command import join_and_report, names_in
    from swarmwire.agent.joining import JoinSettings
    from swarmwire.deploy.certificates.member import member
    from swarmwire.deploy.certificates.register import RUNNER

    of = member(RUNNER, certs=certs, name=name if certs else None, files=(ca, certificate, key), insecure=insecure)
    code = join_and_report(
        JoinSettings(
            endpoint=endpoint,
            robots=robots,
            names=None if names is None else names_in(names),
            agents=tuple(agents or ()),
            scenario=scenario,
            name=name,
            run=run,
            network=of.network,
        )
    )
    if code:
        raise typer.Exit(code)

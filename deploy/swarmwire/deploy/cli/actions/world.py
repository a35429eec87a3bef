"""`swarmwire world`: a run whose agents join from other processes or machines."""

from swarmwire.comms.base.extras import UI
from swarmwire.comms.wire.access_control import WORLD, RunAccess
from swarmwire.deploy.cli.actions.run import run_config, show_run
from swarmwire.deploy.cli.display.progress import JoinProgress
from swarmwire.deploy.cli.run_options import MemberOptions, WorldOptions
from swarmwire.deploy.robots.certificates.member import MemberCredentials, member
from swarmwire.deploy.runs.config import Listening, choose_seeds
from swarmwire.deploy.terminal.console import TerminalConsole
from swarmwire.deploy.terminal.output import echo
from swarmwire.world.scenario_file import load_scenario


def serve_world(options: WorldOptions) -> None:
    """Run a scenario once runners have agents for its robots."""
    if options.views.ui:
        UI.need("--ui")
    scenario = load_scenario(options.scenario, options.start.overrides or ())
    credentials = _credentials(options.members)
    endpoints, observed = tuple(options.endpoints), tuple(options.observed or ())
    credentials.check("--listen", *endpoints)
    credentials.check("--observe", *observed)
    if (warning := credentials.warning([*endpoints, *observed])) is not None:
        echo(f"warning: {warning}", err=True)
    console = TerminalConsole(quiet=options.quiet)
    arenas = len(choose_seeds(scenario, options.start.seed, options.start.seeds))
    robots = tuple(scenario.robot_names()) * arenas
    with JoinProgress(robots, options.start_with, credentials.network, console) as joining:
        listening = Listening(
            endpoints,
            observed,
            credentials.network,
            credentials.access,
            options.start_with,
            observer=joining,
        )
        config = run_config(scenario, options.start, options.recording, listening=listening)
        show_run(config, console, options.views, [joining])


def _credentials(options: MemberOptions) -> MemberCredentials:
    access = RunAccess(
        runners=tuple(options.runners or ()),
        observers=tuple(options.observers or ()),
        operators=tuple(options.operators or ()),
        routers=tuple(options.routers or ()),
    )
    return member(
        WORLD,
        certs=options.certs,
        name=options.name,
        access=access,
        revoked=options.revoked or (),
        insecure=options.insecure,
    )

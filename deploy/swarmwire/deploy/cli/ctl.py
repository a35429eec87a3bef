"""The commands `ctl`: control of live runs from another terminal; commands with events are in `ctl_events.py`."""

from typing import Annotated

import typer

from swarmwire.deploy.cli.options import AsJson, Certs, Endpoint, Insecure, Name, RunChoice
from swarmwire.deploy.terminal.output import flowing

HELP = flowing("""Watch and control running simulations: pause, step, speed, and events for their robots and radios.

With several runs on this machine --run names one; `swarmwire ctl status` prints their ids and folders. Changes to a
run are recorded in its folder: `swarmwire repeat` makes them again, bit for bit.

For example:

  swarmwire ctl status
  swarmwire ctl pause
  swarmwire ctl step 10
  swarmwire ctl kill flock-3 --for 20
  swarmwire ctl set loss=0.6
  swarmwire ctl --run runs/flocking-s1-20261121T030405Z speed max
  swarmwire ctl --endpoint tls/10.0.0.5:7448 --certs lab-certs status
""")


ctl_app = typer.Typer(no_args_is_help=True)


@ctl_app.callback(help=HELP)
def _ctl(
    context: typer.Context,
    run: Annotated[
        str | None,
        typer.Option(help="The id of a run, the start of it, or its folder. Default: the only one.", metavar="RUN"),
    ] = None,
    endpoint: Endpoint = None,
    certs: Certs = None,
    name: Name = None,
    insecure: Insecure = False,
) -> None:
    context.obj = RunChoice(run, endpoint, certs, name, insecure)


@ctl_app.command("status")
def status_command(context: typer.Context, as_json: AsJson = False) -> None:
    """Print the status of a run, or a line for each of several runs on this machine.

    With --json there is a JSON object per run, each on a line. For example:

      swarmwire ctl status

      swarmwire ctl --run 3f2a status --json
    """
    from swarmwire.deploy.cli.actions.status import print_status

    print_status(context.obj, as_json=as_json)


@ctl_app.command("pause")
def pause_command(context: typer.Context) -> None:
    """Pause the run at the end of the current tick, until `resume` or `step`.

    For example:

      swarmwire ctl pause
    """
    from swarmwire.deploy.cli.actions.control import pause

    pause(context.obj)


@ctl_app.command("resume")
def resume_command(context: typer.Context) -> None:
    """Resume a paused run.

    For example:

      swarmwire ctl resume
    """
    from swarmwire.deploy.cli.actions.control import resume

    resume(context.obj)


@ctl_app.command("step")
def step_command(
    context: typer.Context, ticks: Annotated[int, typer.Argument(help="Number of ticks.", min=1, metavar="N")] = 1
) -> None:
    """Run exactly N ticks, then pause.

    For example a second of a run with 10 ticks per second:

      swarmwire ctl step 10
    """
    from swarmwire.deploy.cli.actions.control import step

    step(context.obj, ticks)


@ctl_app.command("speed")
def speed_command(
    context: typer.Context,
    factor: Annotated[str, typer.Argument(help="Simulated seconds per second, or max.", metavar="FACTOR|max")],
) -> None:
    """Set the speed: simulated seconds per second of wall time, or as fast as possible.

    For example at a tenth:

      swarmwire ctl speed 0.1

      swarmwire ctl speed max
    """
    from swarmwire.deploy.cli.actions.control import set_speed

    set_speed(context.obj, factor)


@ctl_app.command("stop")
def stop_command(context: typer.Context) -> None:
    """End the run after the current tick, with its summary and tables.

    For example:

      swarmwire ctl stop
    """
    from swarmwire.deploy.cli.actions.control import stop

    stop(context.obj)

"""The group of commands `swarmwire ctl`."""

from typing import Any

import typer
from typer.core import TyperGroup

from swarmwire.comms.config import did_you_mean
from swarmwire.deploy.catalogue.docstrings import flowing
from swarmwire.deploy.cli.access_options import Ca, Certificate, Certs, Insecure, Key, Name
from swarmwire.deploy.cli.ctl.chosen_run import Chosen, Endpoint
from swarmwire.deploy.cli.ctl.given import end_command, event_command, events_command
from swarmwire.deploy.cli.ctl.pace import (
    pause_command,
    resume_command,
    speed_command,
    step_command,
    stop_command,
)
from swarmwire.deploy.cli.ctl.radio import jam_command, partition_command, set_command
from swarmwire.deploy.cli.ctl.robots import impulse_command, kill_command, revive_command
from swarmwire.deploy.cli.ctl.status import status_command

HELP = flowing("""Runs that go on: how they do, pause, step, speed, and what happens to their robots and radios.

RUN is the id of a run, which `swarmwire ctl status` tells, or its folder; with one run on this machine none need be
named. What is done to a run is recorded in its folder: `swarmwire repeat` does it again, bit for bit.

For example:

  swarmwire ctl status

  swarmwire ctl pause

  swarmwire ctl step 10

  swarmwire ctl kill flock-3 --for 20

  swarmwire ctl set loss=0.6

  swarmwire ctl runs/flocking-s1-20261121T030405Z speed max

  swarmwire ctl --endpoint tls/10.0.0.5:7448 --certs lab-certs status
""")


class CtlGroup(TyperGroup):
    """A group whose commands may follow the name of a run."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Take the run from the first argument that is neither an option nor a command."""
        place, chosen = _first_word(self, args), Chosen()
        if place is not None and args[place] not in self.commands:
            chosen.run = args[place]
            args = [*args[:place], *args[place + 1 :]]
            rest = args[place : place + 1]
            if not rest or (rest[0] not in self.commands and not rest[0].startswith("-")):
                got = rest[0] if rest else chosen.run
                ctx.fail(f"expected {did_you_mean(self.commands, got)}, after the run if one is named; got {got!r}")
        ctx.obj = chosen
        return super().parse_args(ctx, args)


ctl_app = typer.Typer(cls=CtlGroup, help=HELP, no_args_is_help=True)


@ctl_app.callback(help=HELP, subcommand_metavar="[RUN] COMMAND [ARGS]...")
def _ctl(
    context: typer.Context,
    endpoint: Endpoint = None,
    certs: Certs = None,
    name: Name = None,
    ca: Ca = None,
    certificate: Certificate = None,
    key: Key = None,
    insecure: Insecure = False,
) -> None:
    chosen: Chosen = context.obj
    chosen.endpoint, chosen.certs, chosen.name = endpoint, certs, name
    chosen.files, chosen.insecure = (ca, certificate, key), insecure


def _first_word(group: TyperGroup, args: list[str]) -> int | None:
    """The place of the first argument that is neither an option nor the value of one."""
    with_value = {name for of in group.params if not getattr(of, "is_flag", False) for name in of.opts}
    place = 0
    while place < len(args):
        if not args[place].startswith("-"):
            return place
        place += 2 if args[place] in with_value else 1
    return None


ctl_app.command("status")(status_command)
ctl_app.command("pause")(pause_command)
ctl_app.command("resume")(resume_command)
ctl_app.command("step")(step_command)
ctl_app.command("speed")(speed_command)
ctl_app.command("stop")(stop_command)
ctl_app.command("kill")(kill_command)
ctl_app.command("revive")(revive_command)
ctl_app.command("impulse")(impulse_command)
ctl_app.command("partition")(partition_command)
ctl_app.command("jam")(jam_command)
ctl_app.command("set")(set_command)
ctl_app.command("event")(event_command)
ctl_app.command("events")(events_command)
ctl_app.command("end")(end_command)

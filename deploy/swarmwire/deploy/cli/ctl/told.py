"""What the commands of `swarmwire ctl` tell when a run has taken what they asked."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import typer

from swarmwire.deploy.cli.ctl.chosen_run import Chosen, control_of

if TYPE_CHECKING:
    from swarmwire.deploy.control.remote_control import RemoteControl


def tell(reply: Mapping[str, Any]) -> None:
    """A line with what is done, and at which tick the run is."""
    typer.echo(f"{reply['done']} (at tick {reply['tick']})")


def give(chosen: Chosen, table: Mapping[str, Any]) -> None:
    """Have the run take an event, and say how to end it if it lasts."""
    with control_of(chosen) as control:
        give_to(control, table)


def give_to(control: "RemoteControl", table: Mapping[str, Any]) -> None:
    """The same, of a run that is already spoken to."""
    number = control.event(without_none(table))
    typer.echo(f"event {number}: {table['do']}, from the next tick on")


def without_none(table: Mapping[str, Any]) -> dict[str, Any]:
    """An event's table with what is said alone."""
    return {name: value for name, value in table.items() if value is not None}

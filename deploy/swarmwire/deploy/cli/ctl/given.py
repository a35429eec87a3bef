"""`swarmwire ctl event`, `events` and `end`: whatever a scenario could have happen, and what there is of it."""

import tomllib
from typing import Annotated, Any, cast

import typer

from swarmwire.comms.config import from_toml
from swarmwire.comms.errors import BadInput
from swarmwire.deploy.cli.ctl.chosen_run import control_of
from swarmwire.deploy.cli.ctl.told import give, tell

COLUMNS = ("number", "tick", "event", "")


def event_command(
    context: typer.Context,
    table: Annotated[
        str, typer.Argument(help="A table as that of an event in a scenario, without at_s.", metavar="'{ do = …, … }'")
    ],
) -> None:
    """Have any event happen at the start of the next tick; `swarmwire list events` names them.

    For example:

      swarmwire ctl event '{ do = "fail", part = "motors", robots = { count = 3 }, for_s = 10 }'

      swarmwire ctl event '{ do = "partition", halves = "y", bridge = ["flock-0"] }'
    """
    give(context.obj, _table(table))


def events_command(context: typer.Context) -> None:
    """List the run's events, the scenario's and those given: number, tick, what, and whether it is over.

    For example:

      swarmwire ctl events
    """
    from rich.console import Console

    from swarmwire.deploy.terminal.rows import print_rows

    with control_of(context.obj) as control:
        events = control.status()["events"]
    if not events:
        typer.echo("no events")
        return
    rows = [
        (
            str(event["number"]),
            "to come"
            if event["tick"] is None and not event["over"]
            else str(event["tick"] if event["tick"] is not None else ""),
            event["text"],
            "over" if event["over"] else "",
        )
        for event in events
    ]
    print_rows(COLUMNS, rows, Console(highlight=False))


def end_command(
    context: typer.Context,
    number: Annotated[int, typer.Argument(help="Of the event, as `events` tells it.", min=0, metavar="NUMBER")],
) -> None:
    """Undo an event that lasts, such as a kill, a partition, a jammer or a number that was set.

    For example:

      swarmwire ctl end 3
    """
    with control_of(context.obj) as control:
        tell(control.end(number))


def _table(text: str) -> dict[str, Any]:
    try:
        found = from_toml(f"event = {text}")
    except tomllib.TOMLDecodeError as error:
        raise BadInput("event", "", f"expected a TOML table on one line: {error}") from None
    table: object = found["event"]
    if len(found) != 1 or not isinstance(table, dict) or "do" not in table:
        raise BadInput("event", "", 'expected a table with do, such as { do = "kill", robots = { count = 3 } }')
    return cast("dict[str, Any]", table)

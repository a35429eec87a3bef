"""`swarmwire ctl partition`, `jam` and `set`: what happens to the radio."""

from typing import Annotated, Any

import typer

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.cli.ctl.chosen_run import control_of
from swarmwire.deploy.cli.ctl.robots import ForS
from swarmwire.deploy.cli.ctl.selection import selection_of
from swarmwire.deploy.cli.ctl.told import give, give_to

RADIO = "radio."


def partition_command(
    context: typer.Context,
    halves: Annotated[
        str | None,
        typer.Argument(help="x: robots left of the middle against all others; y: those below.", metavar="[x|y]"),
    ] = None,
    between: Annotated[
        list[str] | None,
        typer.Option(help="A set of groups and robots, a,b-3; twice or more: the sets.", metavar="NAMES"),
    ] = None,
    isolate: Annotated[
        str | None, typer.Option(help="Groups and robots, a,b-3, each of which is alone.", metavar="NAMES")
    ] = None,
    one_way: Annotated[
        bool, typer.Option("--one-way", help="Of two sets the second does not hear the first, which hears it.")
    ] = False,
    for_s: ForS = None,
) -> None:
    """Let sets of robots not hear one another, until `end` or after a time.

    For example:

      swarmwire ctl partition x

      swarmwire ctl partition --between flock-0,flock-1 --between scouts --for 30

      swarmwire ctl partition --isolate flock-3
    """
    table: dict[str, Any] = {
        "do": "partition",
        "halves": halves,
        "between": None if between is None else [_names(item) for item in between],
        "isolate": None if isolate is None else _names(isolate),
        "one_way": one_way or None,
        "for_s": for_s,
    }
    give(context.obj, table)


def jam_command(
    context: typer.Context,
    robots: Annotated[
        list[str] | None, typer.Argument(help="Who carry a jammer each, as for kill.", metavar="[ROBOTS]")
    ] = None,
    at: Annotated[
        str | None, typer.Option(help="Where it stands, in m from the arena's middle.", metavar="X,Y")
    ] = None,
    power_dbm: Annotated[float, typer.Option("--power", help="What it radiates, dBm.", metavar="DBM")] = 20.0,
    duty: Annotated[float | None, typer.Option(help="The share of time for which it is on. Default: 1.")] = None,
    for_s: ForS = None,
) -> None:
    """Put up a jammer, in runs whose radio has signals, until `end` or after a time.

    For example in the middle:

      swarmwire ctl jam --at 0,0 --power 10

      swarmwire ctl jam flock-3 --for 30
    """
    table: dict[str, Any] = {
        "do": "jammer",
        "at": None if at is None else _place(at),
        "robots": selection_of(robots) if robots else None,
        "power_dbm": power_dbm,
        "duty": duty,
        "for_s": for_s,
    }
    give(context.obj, table)


def set_command(
    context: typer.Context,
    settings: Annotated[list[str], typer.Argument(help="Numbers of the radio, such as loss=0.5.", metavar="KEY=VALUE")],
    over_s: Annotated[
        float, typer.Option("--over", help="How long the way there takes, simulated seconds.", min=0, metavar="S")
    ] = 0.0,
) -> None:
    """Set numbers of the radio, at once or evenly over a time; `swarmwire ctl status` tells what they are.

    For example:

      swarmwire ctl set loss=0.6 latency_s=0.2

      swarmwire ctl set range_m=0.5 --over 20
    """
    tables = [_ramp(setting, over_s) for setting in settings]
    with control_of(context.obj) as control:
        for table in tables:
            give_to(control, table)


def _ramp(setting: str, over_s: float) -> dict[str, Any]:
    key, equals, value = setting.partition("=")
    try:
        to = float(value)
    except ValueError:
        equals, to = "", 0.0
    if not equals or not key:
        raise BadInput("KEY=VALUE", "", f"expected a number for a key of [radio], such as loss=0.5; got {setting!r}")
    return {"do": "ramp", "what": RADIO + key.strip().removeprefix(RADIO), "to": to, "over_s": over_s}


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]


def _place(text: str) -> list[float]:
    try:
        x_m, y_m = map(float, text.split(","))
    except ValueError:
        raise BadInput("--at", "", f"expected two numbers such as 1.5,-2; got {text!r}") from None
    return [x_m, y_m]

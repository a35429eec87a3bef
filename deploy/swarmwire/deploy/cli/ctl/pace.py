"""`swarmwire ctl pause`, `resume`, `step`, `speed` and `stop`: when ticks begin, not what is in them."""

from typing import Annotated

import typer

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.cli.ctl.chosen_run import control_of
from swarmwire.deploy.cli.ctl.told import tell


def pause_command(context: typer.Context) -> None:
    """Let no tick begin from now on, until `resume` or `step`.

    For example:

      swarmwire ctl pause
    """
    with control_of(context.obj) as control:
        tell(control.pause())


def resume_command(context: typer.Context) -> None:
    """Go on.

    For example:

      swarmwire ctl resume
    """
    with control_of(context.obj) as control:
        tell(control.resume())


def step_command(
    context: typer.Context, ticks: Annotated[int, typer.Argument(help="How many ticks.", min=1, metavar="N")] = 1
) -> None:
    """Let exactly N ticks go, then pause.

    For example a second of a run with 10 ticks per second:

      swarmwire ctl step 10
    """
    with control_of(context.obj) as control:
        tell(control.step(ticks))


def speed_command(
    context: typer.Context,
    factor: Annotated[str, typer.Argument(help="Simulated seconds per second, or max.", metavar="FACTOR|max")],
) -> None:
    """Go at so many simulated seconds per second of wall time, or as fast as possible.

    For example at a tenth:

      swarmwire ctl speed 0.1

      swarmwire ctl speed max
    """
    with control_of(context.obj) as control:
        tell(control.speed(None if factor == "max" else _number(factor)))


def stop_command(context: typer.Context) -> None:
    """End the run after the tick that is under way, with its summary and tables.

    For example:

      swarmwire ctl stop
    """
    with control_of(context.obj) as control:
        tell(control.stop())


def _number(text: str) -> float:
    try:
        return float(text.removeprefix("x"))
    except ValueError:
        raise BadInput("FACTOR", "", f"expected a number such as 0.5, or max; got {text!r}") from None

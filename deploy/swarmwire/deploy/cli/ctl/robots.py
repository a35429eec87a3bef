"""`swarmwire ctl kill`, `revive` and `impulse`: what happens to robots."""

from typing import Annotated

import typer

from swarmwire.deploy.cli.ctl.selection import selection_of
from swarmwire.deploy.cli.ctl.told import give

Which = Annotated[
    list[str],
    typer.Argument(
        help="Names (flock-3), a group (flock), a number of them (5), a share (20%), or all.", metavar="ROBOTS"
    ),
]
ForS = Annotated[
    float | None, typer.Option("--for", help="Undone after so many simulated seconds. Default: not.", metavar="S")
]


def kill_command(context: typer.Context, robots: Which, for_s: ForS = None) -> None:
    """Kill robots: they stop where they stand, and say nothing.

    For example two by name, or five drawn for 20 s:

      swarmwire ctl kill flock-3 flock-7

      swarmwire ctl kill 5 --for 20

      swarmwire ctl kill scouts 50%
    """
    give(context.obj, {"do": "kill", "robots": selection_of(robots), "for_s": for_s})


def revive_command(context: typer.Context, robots: Which) -> None:
    """Have robots that were killed act again, with a fresh memory.

    For example all of them:

      swarmwire ctl revive all
    """
    give(context.obj, {"do": "revive", "robots": selection_of(robots)})


def impulse_command(
    context: typer.Context,
    robots: Which,
    speed_mps: Annotated[float, typer.Option("--speed", help="Added to their velocity, m/s.", metavar="M/S")],
    direction_rad: Annotated[
        float, typer.Option("--direction", help="Where to, in the arena: 0 along x, 1.57 along y.", metavar="RAD")
    ] = 0.0,
) -> None:
    """Push robots: their velocity changes at once; then it is up to their motors.

    For example along y:

      swarmwire ctl impulse flock-3 --speed 0.5 --direction 1.57
    """
    table = {"do": "impulse", "robots": selection_of(robots), "speed_mps": speed_mps, "direction_rad": direction_rad}
    give(context.obj, table)

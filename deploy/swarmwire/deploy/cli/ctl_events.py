"""The commands of `ctl` that inject events: into the robots, the radio, or any event of a scenario."""

from typing import Annotated

import typer

from swarmwire.deploy.cli.ctl import ctl_app

RobotSelection = Annotated[
    list[str],
    typer.Argument(
        help="Names (flock-3), a group (flock), a number of them (5), a share (20%), or all.", metavar="ROBOTS"
    ),
]
ForS = Annotated[
    float | None,
    typer.Option("--for", help="Revert after this many simulated seconds. Default: permanent.", metavar="S"),
]

events_app = typer.Typer()


@events_app.command("kill")
def kill_command(context: typer.Context, robots: RobotSelection, for_s: ForS = None) -> None:
    """Kill robots: they stop and send nothing.

    For example two by name, or five drawn for 20 s:

      swarmwire ctl kill flock-3 flock-7

      swarmwire ctl kill 5 --for 20

      swarmwire ctl kill scouts 50%
    """
    from swarmwire.deploy.cli.actions.inject import inject, robot_selection

    inject(context.obj, {"do": "kill", "robots": robot_selection(robots), "for_s": for_s})


@events_app.command("revive")
def revive_command(context: typer.Context, robots: RobotSelection) -> None:
    """Revive killed robots, with an empty memory.

    For example all of them:

      swarmwire ctl revive all
    """
    from swarmwire.deploy.cli.actions.inject import inject, robot_selection

    inject(context.obj, {"do": "revive", "robots": robot_selection(robots)})


@events_app.command("impulse")
def impulse_command(
    context: typer.Context,
    robots: RobotSelection,
    speed_mps: Annotated[float, typer.Option("--speed", help="Speed added to their velocity, m/s.", metavar="M/S")],
    direction_rad: Annotated[
        float, typer.Option("--direction", help="Direction in the arena: 0 along x, 1.57 along y.", metavar="RAD")
    ] = 0.0,
) -> None:
    """Push robots: their velocity changes at once, then their motors correct it.

    For example along y:

      swarmwire ctl impulse flock-3 --speed 0.5 --direction 1.57
    """
    from swarmwire.deploy.cli.actions.inject import inject, robot_selection

    selection = robot_selection(robots)
    event = {"do": "impulse", "robots": selection, "speed_mps": speed_mps, "direction_rad": direction_rad}
    inject(context.obj, event)


@events_app.command("partition")
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
        str | None, typer.Option(help="Groups and robots, a,b-3, each isolated from all others.", metavar="NAMES")
    ] = None,
    for_s: ForS = None,
) -> None:
    """Block radio between sets of robots, until `end` or for a time.

    For example:

      swarmwire ctl partition x

      swarmwire ctl partition --between flock-0,flock-1 --between scouts --for 30

      swarmwire ctl partition --isolate flock-3
    """
    from swarmwire.deploy.cli.actions.inject import inject, split_names

    event = {
        "do": "partition",
        "halves": halves,
        "between": None if between is None else [split_names(names) for names in between],
        "isolate": None if isolate is None else split_names(isolate),
        "for_s": for_s,
    }
    inject(context.obj, event)


@events_app.command("jam")
def jam_command(
    context: typer.Context,
    robots: Annotated[
        list[str] | None, typer.Argument(help="Robots that carry a jammer each, as for kill.", metavar="[ROBOTS]")
    ] = None,
    position: Annotated[
        str | None, typer.Option("--at", help="Position, in m from the arena's middle.", metavar="X,Y")
    ] = None,
    power_dbm: Annotated[float, typer.Option("--power", help="Radiated power, dBm.", metavar="DBM")] = 20.0,
    for_s: ForS = None,
) -> None:
    """Place a jammer, in runs whose radio has a PHY, until `end` or for a time.

    For example in the middle:

      swarmwire ctl jam --at 0,0 --power 10

      swarmwire ctl jam flock-3 --for 30
    """
    from swarmwire.deploy.cli.actions.inject import inject, parse_position, robot_selection

    event = {
        "do": "jammer",
        "at": None if position is None else parse_position(position),
        "robots": robot_selection(robots) if robots else None,
        "power_dbm": power_dbm,
        "for_s": for_s,
    }
    inject(context.obj, event)


@events_app.command("set")
def set_command(
    context: typer.Context,
    settings: Annotated[list[str], typer.Argument(help="Numbers of the radio, such as loss=0.5.", metavar="KEY=VALUE")],
    over_s: Annotated[
        float, typer.Option("--over", help="Change evenly over this many simulated seconds.", min=0, metavar="S")
    ] = 0.0,
) -> None:
    """Set numbers of the radio, at once or evenly over a time; `swarmwire ctl status` prints them.

    For example:

      swarmwire ctl set loss=0.6 latency_s=0.2

      swarmwire ctl set range_m=0.5 --over 20
    """
    from swarmwire.deploy.cli.actions.inject import set_radio

    set_radio(context.obj, settings, over_s)


@events_app.command("event")
def event_command(
    context: typer.Context,
    table: Annotated[
        str, typer.Argument(help="An event's table as in a scenario, without at_s.", metavar="'{ do = …, … }'")
    ],
) -> None:
    """Inject any event at the start of the next tick; `swarmwire list events` names them.

    For example:

      swarmwire ctl event '{ do = "fail", part = "motors", robots = { count = 3 }, for_s = 10 }'

      swarmwire ctl event '{ do = "partition", halves = "y", bridge = ["flock-0"] }'
    """
    from swarmwire.deploy.cli.actions.inject import inject, parse_event

    inject(context.obj, parse_event(table))


@events_app.command("end")
def end_command(
    context: typer.Context,
    number: Annotated[
        int, typer.Argument(help="Number of the event, from `swarmwire ctl status`.", min=0, metavar="NUMBER")
    ],
) -> None:
    """End a lasting event, such as a kill, a partition, a jammer or a changed number.

    For example:

      swarmwire ctl end 3
    """
    from swarmwire.deploy.cli.actions.inject import end_event

    end_event(context.obj, number)


ctl_app.add_typer(events_app)

"""Commands of `swarmwire ctl` that give a run an event: for its robots, its radio, or any that a scenario can have."""

import tomllib
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.cli.ctl import RunChoice, control_of, ctl_app, tell
from swarmwire.deploy.terminal.output import echo

if TYPE_CHECKING:
    from swarmwire.deploy.live.remote_control import RemoteControl


Which = Annotated[
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
def kill_command(context: typer.Context, robots: Which, for_s: ForS = None) -> None:
    """Kill robots: they stop and send nothing.

    For example two by name, or five drawn for 20 s:

      swarmwire ctl kill flock-3 flock-7

      swarmwire ctl kill 5 --for 20

      swarmwire ctl kill scouts 50%
    """
    give(context.obj, {"do": "kill", "robots": selection_of(robots), "for_s": for_s})


@events_app.command("revive")
def revive_command(context: typer.Context, robots: Which) -> None:
    """Revive killed robots, with an empty memory.

    For example all of them:

      swarmwire ctl revive all
    """
    give(context.obj, {"do": "revive", "robots": selection_of(robots)})


@events_app.command("impulse")
def impulse_command(
    context: typer.Context,
    robots: Which,
    speed_mps: Annotated[float, typer.Option("--speed", help="Speed added to their velocity, m/s.", metavar="M/S")],
    direction_rad: Annotated[
        float, typer.Option("--direction", help="Direction in the arena: 0 along x, 1.57 along y.", metavar="RAD")
    ] = 0.0,
) -> None:
    """Push robots: their velocity changes at once, then their motors correct it.

    For example along y:

      swarmwire ctl impulse flock-3 --speed 0.5 --direction 1.57
    """
    table = {"do": "impulse", "robots": selection_of(robots), "speed_mps": speed_mps, "direction_rad": direction_rad}
    give(context.obj, table)


RADIO = "radio."


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
    table: dict[str, Any] = {
        "do": "partition",
        "halves": halves,
        "between": None if between is None else [_names(item) for item in between],
        "isolate": None if isolate is None else _names(isolate),
        "for_s": for_s,
    }
    give(context.obj, table)


@events_app.command("jam")
def jam_command(
    context: typer.Context,
    robots: Annotated[
        list[str] | None, typer.Argument(help="Robots that carry a jammer each, as for kill.", metavar="[ROBOTS]")
    ] = None,
    at: Annotated[str | None, typer.Option(help="Position, in m from the arena's middle.", metavar="X,Y")] = None,
    power_dbm: Annotated[float, typer.Option("--power", help="Radiated power, dBm.", metavar="DBM")] = 20.0,
    for_s: ForS = None,
) -> None:
    """Place a jammer, in runs whose radio has a PHY, until `end` or for a time.

    For example in the middle:

      swarmwire ctl jam --at 0,0 --power 10

      swarmwire ctl jam flock-3 --for 30
    """
    table: dict[str, Any] = {
        "do": "jammer",
        "at": None if at is None else _place(at),
        "robots": selection_of(robots) if robots else None,
        "power_dbm": power_dbm,
        "for_s": for_s,
    }
    give(context.obj, table)


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
    give(context.obj, _table(table))


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
    with control_of(context.obj) as control:
        tell(control.end(number))


def _table(text: str) -> dict[str, Any]:
    from swarmwire.comms.base.config import from_toml

    try:
        found = from_toml(f"event = {text}")
    except tomllib.TOMLDecodeError as error:
        raise BadInput("event", "", f"expected a TOML table on one line: {error}") from None
    table: object = found["event"]
    if len(found) != 1 or not isinstance(table, dict) or "do" not in table:
        raise BadInput("event", "", 'expected a table with do, such as { do = "kill", robots = { count = 3 } }')
    return cast("dict[str, Any]", table)


ALL = "all"


def selection_of(words: Sequence[str]) -> dict[str, Any]:
    """The selection of names, or of a group, a number or a share, or of both; BadInput for anything else.

    >>> selection_of(["flock-3", "flock-7"]), selection_of(["flock", "20%"]), selection_of(["all"])
    ({'names': ['flock-3', 'flock-7']}, {'group': 'flock', 'share': 0.2}, {'share': 1.0})
    """
    given = [part for word in words for part in word.split(",") if part]
    if given == [ALL]:
        return {"share": 1.0}
    if given and all(_is_name(word) for word in given):
        return {"names": given}
    amounts = [word for word in given if word[:1].isdigit()]
    groups = [word for word in given if word not in amounts]
    if len(amounts) > 1 or len(groups) > 1 or any(map(_is_name, groups)):
        expected = "expected names such as flock-3, or a group, a number or share of it such as 5 or 20%, or all"
        raise BadInput("ROBOTS", "", f"{expected}; got {' '.join(words)}")
    selection: dict[str, Any] = {"group": groups[0]} if groups else {}
    return selection | (_amount(amounts[0]) if amounts else {})


def _is_name(word: str) -> bool:
    group, dash, number = word.rpartition("-")
    return bool(group and dash) and number.isdecimal()


def _amount(word: str) -> dict[str, Any]:
    try:
        return {"share": float(word[:-1]) / 100.0} if word.endswith("%") else {"count": int(word)}
    except ValueError:
        raise BadInput("ROBOTS", "", f"expected a number such as 5, or a share such as 20%; got {word!r}") from None


def give(chosen: RunChoice, table: Mapping[str, Any]) -> None:
    """Have the run take an event, and say how to end it if it lasts."""
    with control_of(chosen) as control:
        give_to(control, table)


def give_to(control: "RemoteControl", table: Mapping[str, Any]) -> None:
    """The same, of a run that is already spoken to."""
    number = control.event(without_none(table))
    echo(f"event {number}: {table['do']}, from the next tick on")


def without_none(table: Mapping[str, Any]) -> dict[str, Any]:
    """An event's table with what is said alone."""
    return {name: value for name, value in table.items() if value is not None}


ctl_app.add_typer(events_app)

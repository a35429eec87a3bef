"""Events that `swarmwire ctl` injects into a live run."""

import tomllib
from collections.abc import Mapping, Sequence
from typing import Any, cast

from swarmwire.comms.base.config import from_toml
from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.cli.actions.control import control_of, print_reply
from swarmwire.deploy.cli.options import RunChoice
from swarmwire.deploy.live.remote_control import RemoteControl
from swarmwire.deploy.terminal.output import echo

ALL = "all"
RADIO = "radio."


def inject(choice: RunChoice, event: Mapping[str, Any]) -> None:
    """Inject an event into the chosen run, and print its number, with which `end` ends it."""
    with control_of(choice) as control:
        _inject(control, event)


def _inject(control: RemoteControl, event: Mapping[str, Any]) -> None:
    number = control.event({name: value for name, value in event.items() if value is not None})
    echo(f"event {number}: {event['do']}, from the next tick on")


def set_radio(choice: RunChoice, settings: Sequence[str], over_s: float) -> None:
    """Change numbers of the radio, evenly over a time; BadInput for a setting that is no KEY=NUMBER."""
    events = [_ramp(setting, over_s) for setting in settings]
    with control_of(choice) as control:
        for event in events:
            _inject(control, event)


def _ramp(setting: str, over_s: float) -> dict[str, Any]:
    key, _, text = setting.partition("=")
    try:
        value = float(text)
    except ValueError:
        value = None
    if value is None or not key:
        raise BadInput("KEY=VALUE", "", f"expected a number for a key of [radio], such as loss=0.5; got {setting!r}")
    return {"do": "ramp", "what": RADIO + key.strip().removeprefix(RADIO), "to": value, "over_s": over_s}


def end_event(choice: RunChoice, number: int) -> None:
    """End a lasting event."""
    with control_of(choice) as control:
        print_reply(control.end(number))


def split_names(text: str) -> list[str]:
    """Split a list of names such as "flock-0,flock-3"."""
    return [name.strip() for name in text.split(",") if name.strip()]


def parse_position(text: str) -> list[float]:
    """Parse a position such as "1.5,-2"."""
    try:
        x_m, y_m = map(float, text.split(","))
    except ValueError:
        raise BadInput("--at", "", f"expected two numbers such as 1.5,-2; got {text!r}") from None
    return [x_m, y_m]


def parse_event(text: str) -> dict[str, Any]:
    """Parse an event's table in TOML."""
    try:
        document = from_toml(f"event = {text}")
    except tomllib.TOMLDecodeError as error:
        raise BadInput("event", "", f"expected a TOML table on one line: {error}") from None
    table: object = document["event"]
    if len(document) != 1 or not isinstance(table, dict) or "do" not in table:
        raise BadInput("event", "", 'expected a table with do, such as { do = "kill", robots = { count = 3 } }')
    return cast("dict[str, Any]", table)


def robot_selection(words: Sequence[str]) -> dict[str, Any]:
    """Parse names of robots, or a group, a number or a share, or a group and an amount; BadInput for anything else.

    >>> robot_selection(["flock-3", "flock-7"]), robot_selection(["flock", "20%"]), robot_selection(["all"])
    ({'names': ['flock-3', 'flock-7']}, {'group': 'flock', 'share': 0.2}, {'share': 1.0})
    """
    parts = [part for word in words for part in word.split(",") if part]
    if parts == [ALL]:
        return {"share": 1.0}
    if parts and all(map(_is_robot_name, parts)):
        return {"names": parts}
    amounts = [part for part in parts if part[:1].isdigit()]
    groups = [part for part in parts if part not in amounts]
    if len(amounts) > 1 or len(groups) > 1 or any(map(_is_robot_name, groups)):
        expected = "expected names such as flock-3, or a group, a number or share of it such as 5 or 20%, or all"
        raise BadInput("ROBOTS", "", f"{expected}; got {' '.join(words)}")
    selection: dict[str, Any] = {"group": groups[0]} if groups else {}
    return selection | (_amount(amounts[0]) if amounts else {})


def _is_robot_name(word: str) -> bool:
    group, dash, number = word.rpartition("-")
    return bool(group and dash) and number.isdecimal()


def _amount(word: str) -> dict[str, Any]:
    try:
        return {"share": float(word[:-1]) / 100.0} if word.endswith("%") else {"count": int(word)}
    except ValueError:
        raise BadInput("ROBOTS", "", f"expected a number such as 5, or a share such as 20%; got {word!r}") from None

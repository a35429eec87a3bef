"""Drivers that are installed, by entry points of the group `swarmwire.drivers`; imported when one is asked for."""

from dataclasses import MISSING, Field, fields
from typing import Any

from swarmwire.agent.drivers.driver import Driver
from swarmwire.comms.config import limits_of
from swarmwire.comms.errors import BadInput
from swarmwire.comms.plugins import installed_class, installed_points

GROUP = "swarmwire.drivers"  # of entry points


def driver_names() -> list[str]:
    """The names of all drivers that are installed."""
    return list(installed_points(GROUP))


def load_driver(name: str, where: str, key: str) -> type[Driver]:
    """The driver of that name; BadInput at `where` and `key` as `installed_class`."""
    return installed_class(GROUP, name, Driver, "driver", where, key)


def told_drivers() -> list[str]:
    """Every driver in lines for people: its name, body and options, or why it cannot be used."""
    lines: list[str] = []
    for name in driver_names():
        try:
            kind = load_driver(name, "", "")
        except BadInput as error:
            lines.append(f"{name}: {error.expected}")
            continue
        told = (kind.__doc__ or "").strip().partition("\n")[0]
        lines.append(f"{name}: {told} Body: {kind.body_name}")
        lines += [f"  {told_option(of)}" for of in fields(kind.options)]
    return lines or ["no drivers are installed"]


def told_option(of: "Field[Any]") -> str:
    """An option in a line: its name, default, unit and meaning."""
    limits = limits_of(of)
    value = "must be given" if of.default is MISSING else f"{of.default!r}{f' {limits.unit}' if limits.unit else ''}"
    return f"{of.name} ({value}): {limits.help}"

"""An actuator of the user's own: what its table in a body's sheet says, and what its class tells agents."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from swarmwire.comms.bodies.tables import built, mapping_of
from swarmwire.comms.errors import BadInput
from swarmwire.comms.parameters import parameter
from swarmwire.comms.plain_values import check_plain
from swarmwire.comms.sheets.own import MOST_WIDE, kind_of


@dataclass(frozen=True)
class ActuatorSheet:
    """An actuator whose class is the user's own; agents set it by `robot.actuate(name, …)`."""

    kind: str = parameter(
        help='"file.py:Class" beside the sheet, "package.module:Class", or the name of an entry point'
    )
    params: dict[str, Any] = parameter(help="keys of the class, as the sheet gives them; agents are not told")
    width: int = parameter(0, help="how many numbers it takes; 0: not known yet")


def actuator_sheet(value: object, where: str, key: str, beside: Path) -> ActuatorSheet:
    """The sheet of a user's table, which has a `kind`; its width is known once the class is."""
    table = mapping_of(where, key, value)
    if "kind" not in table:
        raise BadInput(where, f"{key}.kind", "is missing")
    kind = kind_of(table, where, key, beside)
    check_plain(table, where, key)
    return built(ActuatorSheet, {"kind": kind, "params": table}, where, key)


def told_actuator_sheet(value: object, where: str, key: str) -> ActuatorSheet:
    """The sheet that `asdict` made into this table; only that knows `params` and `width` from keys of the class."""
    table = mapping_of(where, key, value)
    mapping_of(where, f"{key}.params", table.get("params"))
    width = table.get("width")
    if type(width) is not int or not 0 <= width <= MOST_WIDE:
        raise BadInput(where, f"{key}.width", f"expected a whole number from 0 to {MOST_WIDE}, got {width!r}")
    return built(ActuatorSheet, table, where, key)

"""Arguments that commands for robots share, and which robots they mean."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarmwire.comms.extras import FLEET

if TYPE_CHECKING:
    from swarmwire.deploy.fleet.fleet import Fleet, Robot

FleetFile = Annotated[Path, typer.Argument(help="The fleet, a TOML file.", metavar="FLEET")]
OfRobots = Annotated[
    list[str] | None,
    typer.Option("--robots", help="Only these robots: flock-0,flock-3. Repeatable. Default: all.", metavar="NAMES"),
]
OfGroups = Annotated[
    list[str] | None, typer.Option("--group", help="Only the robots of these groups. Repeatable.", metavar="NAMES")
]


def chosen(file: Path, robots: Sequence[str] | None, groups: Sequence[str] | None) -> "tuple[Fleet, Sequence[Robot]]":
    """The fleet and the robots that are meant; BadInput without the extra [fleet]."""
    FLEET.need("robots")
    from swarmwire.deploy.fleet.fleet_file import read_fleet

    fleet = read_fleet(file)
    return fleet, fleet.chosen(_names(robots), _names(groups))


def _names(given: Sequence[str] | None) -> list[str]:
    """Of texts such as "a,b"."""
    return [name.strip() for text in given or [] for name in text.split(",") if name.strip()]

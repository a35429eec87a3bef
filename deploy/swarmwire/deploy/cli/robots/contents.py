"""What goes to each robot, checked here before anything is sent."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.fleet.archive import Entry
from swarmwire.deploy.fleet.fleet import Fleet, Robot


@dataclass(frozen=True)
class Contents:
    """By robot: the entries of its release, what it will be in words, or what is wrong with its settings."""

    entries: dict[str, list[Entry]] = field(default_factory=dict[str, list[Entry]])
    told: dict[str, str] = field(default_factory=dict[str, str])
    faults: dict[str, BadInput] = field(default_factory=dict[str, BadInput])


def contents_of(fleet: Fleet, robots: Sequence[Robot]) -> Contents:
    """The contents for these robots; nothing is raised for what is wrong with one."""
    from swarmwire.deploy.fleet.local_check import check_robot
    from swarmwire.deploy.fleet.release import release_entries

    revoked = fleet.revoked()
    contents = Contents()
    for robot in robots:
        try:
            entries = release_entries(fleet, robot, revoked)
            contents.told[robot.name] = check_robot(fleet, robot, entries)
            contents.entries[robot.name] = entries
        except BadInput as error:
            contents.faults[robot.name] = error
    return contents

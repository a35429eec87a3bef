"""What can be known of a robot's settings before anything is sent: whether agent, body, driver and radio fit."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from swarmwire.agent.on_robot.plan import robot_config
from swarmwire.agent.on_robot.settings import read_settings
from swarmwire.comms.clock import WallClock
from swarmwire.comms.errors import BadInput
from swarmwire.deploy.fleet.archive import Entry
from swarmwire.deploy.fleet.fleet import Fleet, Robot
from swarmwire.deploy.fleet.robot_settings import SETTINGS_FILE


def check_robot(fleet: Fleet, robot: Robot, entries: Sequence[Entry]) -> str:
    """What the robot will be, in words; BadInput names the place in `fleet.toml` of what does not fit.

    The files of its release are read as the robot would read them.
    """
    with TemporaryDirectory() as folder:
        for entry in entries:
            path = Path(folder, entry.name)
            path.touch(mode=entry.mode)
            path.write_bytes(entry.data)
        file = Path(folder, SETTINGS_FILE)
        try:
            return str(robot_config(read_settings(file, {}), str(file), WallClock()))
        except BadInput as error:
            raise BadInput(*_place_in(fleet, robot, error, Path(folder))) from None


def _place_in(fleet: Fleet, robot: Robot, error: BadInput, folder: Path) -> tuple[str, str, str]:
    """File, key and what was expected, as people wrote them."""
    first, _, rest = error.key.partition(".")
    key = ".".join(filter(None, (robot.places.get(first, f"robots.{robot.name}.{first}".rstrip(".")), rest)))
    beside = Path(error.where)
    if beside.is_relative_to(folder) and beside.name != SETTINGS_FILE:  # of a body's sheet
        return beside.name, error.key, error.expected
    return str(fleet.file), key, error.expected.replace(f"{folder}/", "")

"""What people write for robots: a fleet, the settings of one, and the register of certificates."""

import json
import shutil
from pathlib import Path

from swarmwire.agent.on_robot.settings_file import read_settings
from swarmwire.deploy.certificates.folder_access import access_in, network_in
from swarmwire.deploy.certificates.register import Register
from swarmwire.deploy.fleet.fleet_file import read_fleet
from swarmwire.deploy.fleet.robot_settings import robot_settings
from tests.tools.fuzz.folder_target import FolderTarget
from tests.unit.agent.on_robot.test_settings_file import WHOLE
from tests.unit.deploy.fleet.test_fleet_file import EXAMPLE

ISSUED = {"hosts": ["10.0.0.1"], "valid_from": "2026-01-01T00:00:00Z", "valid_until": "2027-01-01T00:00:00Z"}


class Fleets(FolderTarget):
    """Fleet files."""

    name = "fleet"
    quick = 300
    inner = ("robots", "defaults", "groups")

    def make(self, folder: Path) -> None:
        """The example."""
        shutil.copytree(EXAMPLE.parent, folder)

    def is_read(self, path: Path) -> bool:
        """The file itself."""
        return path.name == EXAMPLE.name

    def read(self, folder: Path, *, deep: bool) -> None:
        """The fleet, and what its robots are told."""
        fleet = read_fleet(folder / EXAMPLE.name)
        for robot in fleet.robots:
            robot_settings(fleet, robot, ())


class Settings(FolderTarget):
    """Settings of a robot."""

    name = "robot-settings"
    quick = 300
    inner = ("driver", "radio", "network")

    def make(self, folder: Path) -> None:
        """All that may be said."""
        folder.mkdir()
        (folder / "robot.toml").write_text(WHOLE)

    def read(self, folder: Path, *, deep: bool) -> None:
        """The settings."""
        read_settings(folder / "robot.toml", {})


class Certificates(FolderTarget):
    """The register of a CA's folder, and what follows from it; certificates themselves are `cryptography`'s affair."""

    name = "certificates"
    quick = 300
    inner = ("certificates", "authority")

    def make(self, folder: Path) -> None:
        """A CA that has issued two certificates, one of which is revoked."""
        folder.mkdir()
        of = {"serial": "1f", "revoked": None, **ISSUED}
        issued = [
            {"name": "world", "purpose": "world", **of},
            {"name": "one", "purpose": "runner", **of, "revoked": "2026-06-01T00:00:00Z"},
        ]
        content = {"format": 1, "authority": {"name": "ca", "purpose": "ca", **of}, "certificates": issued}
        (folder / "certs.json").write_text(json.dumps(content))
        for name in ("ca.pem", "world.pem", "world.key"):
            (folder / name).write_text("a certificate, or a key\n")
            (folder / name).chmod(0o600)

    def is_read(self, path: Path) -> bool:
        """The register."""
        return path.name == "certs.json"

    def read(self, folder: Path, *, deep: bool) -> None:
        """Who may do what."""
        Register.read(folder)
        access_in(folder)
        network_in(folder, "world", "world")

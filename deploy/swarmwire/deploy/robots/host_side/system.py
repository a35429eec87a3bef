"""System of a host: facts of the machine, and the systemd units of robots under the user's own manager."""

import getpass
import os
import platform
import shutil
import struct
import subprocess
import sys
import time
from pathlib import Path

from swarmwire.deploy.robots.host_side.files import (
    Refusal,
    complete_folders,
    current_release,
    environment_folder,
    read_status,
    releases_folder,
    replace_file,
)
from swarmwire.deploy.robots.host_side.messages import HostFacts, Inventory, RobotReleases, UnitState

TIMEOUT_S = 60.0
PROPERTIES = ("Id", "LoadState", "ActiveState", "SubState", "Result", "MainPID", "NRestarts", "ActiveEnterTimestamp")
REQUIRED = {"LoadState", "ActiveState", "SubState"}  # a state without these properties is unknown
NO_SYSTEMD = "offline"  # word of `systemctl is-system-running`


def unit_of(robot: str) -> str:
    """Return the name of a robot's unit."""
    return f"swarmwire-{robot}.service"


def systemctl(*arguments: str) -> "subprocess.CompletedProcess[str]":
    """Call `systemctl --user`, with the address of the user's manager in the environment.

    Refusal if systemctl is missing or takes too long.
    """
    runtime = os.environ.setdefault("XDG_RUNTIME_DIR", f"/run/user/{os.getuid()}")
    os.environ.setdefault("DBUS_SESSION_BUS_ADDRESS", f"unix:path={runtime}/bus")
    command = ["systemctl", "--user", *arguments]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=False, timeout=TIMEOUT_S)
    except FileNotFoundError:
        raise Refusal("systemd", "there is no systemctl") from None
    except subprocess.TimeoutExpired:
        raise Refusal("systemd", f"systemctl {arguments[0]} takes longer than {TIMEOUT_S:g} s") from None


def systemctl_output(*arguments: str) -> str:
    """Return the output of `systemctl --user`; Refusal if it fails."""
    process = systemctl(*arguments)
    if process.returncode:
        raise Refusal("systemd", (process.stderr or process.stdout).strip().partition("\n")[0])
    return process.stdout


def unit_folder() -> Path:
    """Return the folder of the user's units."""
    return Path.home() / ".config" / "systemd" / "user"


def unit_text(robot: str, release: str | None = None) -> str | None:
    """Return the unit file of a release, or without one the installed unit file; None if it does not exist."""
    folder = unit_folder() if release is None else releases_folder(robot) / release
    path = folder / unit_of(robot)
    return path.read_text(encoding="utf-8") if path.is_file() else None


def install_unit(robot: str, release: str) -> None:
    """Install a release's unit file for the user's manager."""
    text = unit_text(robot, release)
    if text is None:
        raise Refusal("damaged", f"release {release} has no unit file")
    if text != unit_text(robot):
        unit_folder().mkdir(parents=True, exist_ok=True)
        replace_file(unit_folder() / unit_of(robot), text)
        systemctl_output("daemon-reload")


def read_units(robots: list[str]) -> dict[str, UnitState]:
    """Return the state of each robot's unit."""
    blocks = systemctl_output("show", "--property", ",".join(PROPERTIES), *map(unit_of, robots)).split("\n\n")
    if len(blocks) != len(robots):
        raise Refusal("systemd", f"systemctl show reports {len(blocks)} units instead of {len(robots)}")
    states: dict[str, UnitState] = {}
    for robot, block in zip(robots, blocks, strict=True):
        properties = dict(line.split("=", 1) for line in block.splitlines() if "=" in line)
        if REQUIRED - properties.keys():
            raise Refusal("systemd", f"systemctl show does not report the state of {unit_of(robot)}")
        states[robot] = UnitState(
            load=properties["LoadState"],
            active=properties["ActiveState"],
            sub=properties["SubState"],
            result=properties.get("Result", ""),
            restarts=int(properties.get("NRestarts") or 0),
            active_since=properties.get("ActiveEnterTimestamp", ""),
            running=_running_release(robot, properties.get("MainPID", "0")),
            current=current_release(robot),
            status=read_status(robot),
        )
    return states


def control_units(verb: str, robots: list[str]) -> dict[str, str]:
    """Start, stop or restart each unit separately; return the fault of each robot, or ""."""
    faults: dict[str, str] = {}
    for robot in robots:
        try:
            if verb != "stop":
                systemctl("reset-failed", unit_of(robot))  # systemd refuses to start a unit after five failures
            systemctl_output(verb, unit_of(robot))
            faults[robot] = ""
        except Refusal as refusal:
            faults[robot] = refusal.text
    return faults


def _running_release(robot: str, process: str) -> str:
    """Return the release in whose folder the unit's process runs, which need not be the current one."""
    try:
        folder = Path(f"/proc/{process}/cwd").readlink()
    except OSError:
        return ""
    return folder.name if folder.parent == releases_folder(robot).resolve() else ""


def facts() -> HostFacts:
    """Return the facts of this host."""
    return HostFacts(
        python=sys.version_info[:3],
        implementation=sys.implementation.name,
        executable=sys.executable,
        system=platform.system(),
        machine=platform.machine(),
        bits=struct.calcsize("P") * 8,
        libc=platform.libc_ver(),
        free_bytes=shutil.disk_usage(Path.home()).free,
        manager=manager(),
    )


def utc_ns() -> int:
    """Return the host's time in ns since 1970."""
    return time.time_ns()  # noqa: TID251 - a host has no swarmwire, and so none of its clocks


def manager() -> str:
    """Return the state of the user's system manager: "running", "degraded", …; "" if the user has none.

    NO_SYSTEMD if the machine runs another init than systemd.
    """
    try:
        return systemctl("is-system-running").stdout.strip()
    except Refusal:
        return NO_SYSTEMD


def has_linger() -> bool:
    """Return True if the user's units keep running without a login session."""
    return _loginctl("show-user", getpass.getuser(), "--property=Linger").stdout.strip() == "Linger=yes"


def enable_linger() -> str:
    """Let the user's units keep running without a login session; return the fault, or ""."""
    if has_linger():
        return ""
    process = _loginctl("enable-linger")
    return "" if process.returncode == 0 else process.stderr.strip() or f"loginctl ended with {process.returncode}"


def _loginctl(*arguments: str) -> "subprocess.CompletedProcess[str]":
    command = ["loginctl", *arguments]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=False, timeout=TIMEOUT_S)
    except subprocess.TimeoutExpired:
        raise Refusal("systemd", f"loginctl {arguments[0]} takes longer than {TIMEOUT_S:g} s") from None


def read_inventory(robots: list[str]) -> Inventory:
    """Return the environments of this host, and the releases of each robot."""
    releases: dict[str, RobotReleases] = {}
    for robot in robots:
        current = current_release(robot)
        unit_installed = current is not None and unit_text(robot) == unit_text(robot, current)
        releases[robot] = RobotReleases(current, complete_folders(releases_folder(robot)), unit_installed)
    return Inventory(complete_folders(environment_folder("x").parent), releases)

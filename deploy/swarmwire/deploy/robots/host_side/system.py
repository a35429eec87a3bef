"""A host's system: facts of the machine, and the systemd units of robots under the user's own manager."""

import getpass
import os
import platform
import shutil
import struct
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from swarmwire.deploy.robots.host_side.files import Refusal, current, environment, releases, whole_in, write_whole

TIMEOUT_S = 60.0
SHOWN = ("Id", "LoadState", "ActiveState", "SubState", "Result", "MainPID", "NRestarts", "ActiveEnterTimestamp")

ANSWERED = {"LoadState", "ActiveState", "SubState"}  # without these a state is not known
NO_SYSTEMD = "offline"  # as systemctl itself says it


def unit_of(robot: str) -> str:
    """The name of a robot's unit."""
    return f"swarmwire-{robot}.service"


def systemctl(*arguments: str) -> "subprocess.CompletedProcess[str]":
    """A call of `systemctl --user`, which needs to know where the user's manager listens.

    Refusal if it is not there, or takes too long.
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


def managed(*arguments: str) -> str:
    """What `systemctl --user` prints; Refusal if it fails or is not there."""
    done = systemctl(*arguments)
    if done.returncode:
        raise Refusal("systemd", (done.stderr or done.stdout).strip().partition("\n")[0])
    return done.stdout


def unit_folder() -> Path:
    """Where the user's units lie."""
    return Path.home() / ".config" / "systemd" / "user"


def unit_text(robot: str, release: str | None = None) -> str | None:
    """The unit file as a release has it, or as it is installed; None if it is not there."""
    folder = unit_folder() if release is None else releases(robot) / release
    path = folder / unit_of(robot)
    return path.read_text(encoding="utf-8") if path.is_file() else None


def install_unit(robot: str, release: str) -> None:
    """Put a release's unit file to where the manager finds it."""
    text = unit_text(robot, release)
    if text is None:
        raise Refusal("damaged", f"release {release} has no unit file")
    if text != unit_text(robot):
        unit_folder().mkdir(parents=True, exist_ok=True)
        write_whole(unit_folder() / unit_of(robot), text)
        managed("daemon-reload")


def shown(robots: list[str]) -> dict[str, dict[str, str]]:
    """What the manager knows of each robot's unit: `SHOWN`, and the release that it runs, or ""."""
    blocks = managed("show", "--property", ",".join(SHOWN), *map(unit_of, robots)).split("\n\n")
    found: dict[str, dict[str, str]] = {}
    for robot, block in zip(robots, blocks, strict=False):
        known = dict(line.split("=", 1) for line in block.splitlines() if "=" in line)
        if ANSWERED - known.keys():
            raise Refusal("systemd", f"systemctl show does not report the state of {unit_of(robot)}")
        found[robot] = {**dict.fromkeys(SHOWN, ""), **known, "running": _release_of(robot, known.get("MainPID", "0"))}
    return found


def run_units(verb: str, robots: list[str]) -> dict[str, Any]:
    """Start, stop or restart units, each by itself: "" for each robot, or what went wrong."""
    said: dict[str, Any] = {}
    for robot in robots:
        try:
            if verb != "stop":
                systemctl("reset-failed", unit_of(robot))  # or it is not started after five failures
            managed(verb, unit_of(robot))
            said[robot] = ""
        except Refusal as refusal:
            said[robot] = refusal.text
    return said


def _release_of(robot: str, process: str) -> str:
    """The release in whose folder the unit's process works, which needs not be the current one."""
    try:
        folder = Path(f"/proc/{process}/cwd").readlink()
    except OSError:
        return ""
    return folder.name if folder.parent == releases(robot).resolve() else ""


def facts() -> dict[str, Any]:
    """Python, machine, disk, clock and system manager."""
    return {
        "python": list(sys.version_info[:3]),
        "implementation": sys.implementation.name,
        "executable": sys.executable,
        "system": platform.system(),
        "machine": platform.machine(),
        "bits": struct.calcsize("P") * 8,
        "libc": list(platform.libc_ver()),
        "free_bytes": shutil.disk_usage(Path.home()).free,
        "manager": manager(),
    }


def utc_ns() -> int:
    """Time in ns since 1970, as the host has it."""
    return time.time_ns()  # noqa: TID251 - there is no swarmwire here whose clock could tell it


def manager() -> str:
    """What the user's system manager says of itself: "running", "degraded", …; "" if the user has none.

    NO_SYSTEMD if the machine runs another init than systemd.
    """
    try:
        return systemctl("is-system-running").stdout.strip()
    except Refusal:
        return NO_SYSTEMD


def lingers() -> bool:
    """Whether the user's units keep running without a login session."""
    return _loginctl("show-user", getpass.getuser(), "--property=Linger").stdout.strip() == "Linger=yes"


def linger() -> str:
    """Let the user's units keep running without a login session; return the error, or ""."""
    if lingers():
        return ""
    done = _loginctl("enable-linger")
    return "" if done.returncode == 0 else done.stderr.strip() or f"loginctl ended with {done.returncode}"


def _loginctl(*arguments: str) -> "subprocess.CompletedProcess[str]":
    command = ["loginctl", *arguments]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=False, timeout=TIMEOUT_S)
    except subprocess.TimeoutExpired:
        raise Refusal("systemd", f"loginctl {arguments[0]} takes longer than {TIMEOUT_S:g} s") from None


def present(robots: list[str]) -> dict[str, Any]:
    """Which packages there are, and of each robot which releases, which one is current, and whether its unit is."""
    of_robots: dict[str, Any] = {}
    for robot in robots:
        now = current(robot)
        installed = now is not None and unit_text(robot) == unit_text(robot, now)
        of_robots[robot] = {"current": now, "releases": whole_in(releases(robot)), "unit": installed}
    return {"environments": whole_in(environment("x").parent), "robots": of_robots}

"""What a host is, and what is on it."""

import getpass
import platform
import shutil
import struct
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from swarmwire.deploy.fleet.host_side.folders import current, environment, releases, whole_in
from swarmwire.deploy.fleet.host_side.refusal import Refusal
from swarmwire.deploy.fleet.host_side.units import TIMEOUT_S, systemctl, unit_text

NO_SYSTEMD = "offline"  # as systemctl itself says it


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
    """Whether the user's units go on when nobody is logged in."""
    return _loginctl("show-user", getpass.getuser(), "--property=Linger").stdout.strip() == "Linger=yes"


def linger() -> str:
    """Let the user's units go on when nobody is logged in; what went wrong, or ""."""
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

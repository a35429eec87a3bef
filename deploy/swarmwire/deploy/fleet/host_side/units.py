"""The systemd units of robots, in the hands of the user's own manager."""

import os
import subprocess
from pathlib import Path
from typing import Any

from swarmwire.deploy.fleet.host_side.folders import releases, write_whole
from swarmwire.deploy.fleet.host_side.refusal import Refusal

TIMEOUT_S = 60.0
SHOWN = ("Id", "LoadState", "ActiveState", "SubState", "Result", "MainPID", "NRestarts", "ActiveEnterTimestamp")

ANSWERED = {"LoadState", "ActiveState", "SubState"}  # without these a state is not known


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
            raise Refusal("systemd", f"systemctl show does not tell the state of {unit_of(robot)}")
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

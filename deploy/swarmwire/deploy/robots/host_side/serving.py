"""Server of a host: it reads requests from standard input and writes an answer to each to standard output.

It ends with the connection. Changes of the host need the lock, which one deployment has at a time. A release is tried
first, then becomes current in one step; old ones are removed.
"""

import fcntl
import json
import os
import shutil
import socket
import subprocess
import sys
from collections.abc import Callable, Generator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any, BinaryIO, cast

from swarmwire.deploy.robots.host_side import messages, system
from swarmwire.deploy.robots.host_side.files import (
    MAX_RELEASES,
    PART,
    ArchiveStream,
    ConnectionCut,
    Refusal,
    complete_folders,
    current_release,
    environment_folder,
    part_of,
    refusal_of,
    releases_folder,
    replace_file,
    root,
    sync,
    sync_files,
    unpack_part,
)

MAX_LINES = 5  # last lines of a failed trial that are reported


def clear_parts(robots: list[str]) -> None:
    """Remove the remains of interrupted deployments."""
    for folder in (environment_folder("x").parent, *map(releases_folder, robots)):
        for path in folder.glob(f"*{PART}"):
            shutil.rmtree(path, ignore_errors=True)


def put_environment(archive: ArchiveStream, sha256: str, name: str) -> None:
    """Unpack an environment."""
    part = unpack_part(archive, sha256, environment_folder(name))
    os.sync()  # a robot that is switched off now must not have a folder of empty files
    part.rename(environment_folder(name))


def put_release(archive: ArchiveStream, sha256: str, robot: str, name: str) -> None:
    """Unpack a release, incomplete until `switch_release`."""
    sync_files(unpack_part(archive, sha256, releases_folder(robot) / name))


def try_release(robot: str, release: str, packages: list[str], command: list[str], timeout_s: float) -> None:
    """Run a command in an incomplete release, with its packages; Refusal if it fails, and the release is removed."""
    part = part_of(releases_folder(robot) / release)
    try:
        paths = os.pathsep.join(str(part / name) for name in packages)
        process = subprocess.run(
            [sys.executable, *command],
            cwd=part,
            env={**os.environ, "PYTHONPATH": paths},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            check=False,
            timeout=timeout_s,
        )
        if process.returncode:
            lines = (process.stderr or process.stdout).strip().splitlines()[-MAX_LINES:]
            raise Refusal("trial", "\n".join(lines) or f"ended with {process.returncode}")
    except subprocess.TimeoutExpired:
        shutil.rmtree(part, ignore_errors=True)
        raise Refusal("trial", f"takes longer than {timeout_s:g} s") from None
    except BaseException:  # an exit, too, must leave no incomplete folder
        shutil.rmtree(part, ignore_errors=True)
        raise


def switch_release(robot: str, release: str, past: list[str] | None = None) -> None:
    """Make a release the current one atomically: a start before the switch has all files of the old one.

    `past` are the releases before this one; by default the robot's history.
    """
    folder = releases_folder(robot) / release
    part = part_of(folder)
    if folder.is_dir():
        shutil.rmtree(part, ignore_errors=True)
    else:
        part.rename(folder)
        sync(folder.parent)
    system.install_unit(robot, release)
    past = [name for name in (history(robot) if past is None else past) if name != release]
    replace_file(root() / robot / "history", json.dumps([*past, release]))
    link = root() / robot / f"current{PART}"
    link.unlink(missing_ok=True)
    link.symlink_to(Path("releases") / release)
    link.replace(root() / robot / "current")
    sync(root() / robot)


def roll_back(robot: str) -> str:
    """Make the release before the current one current, and forget the latter; Refusal if there is none."""
    past = history(robot)
    if len(past) < 2:
        raise Refusal("first", "there is no release before the current one")
    switch_release(robot, past[-2], past[:-2])
    return past[-2]


def history(robot: str) -> list[str]:
    """Return the existing releases in the order in which they became current; the current one is the last."""
    try:
        names: list[str] = json.loads((root() / robot / "history").read_text(encoding="utf-8"))
    except (OSError, ValueError):  # no history yet, or the disk lost it: the link still shows the current release
        names = []
    current, existing = current_release(robot), set(complete_folders(releases_folder(robot)))
    past = [name for name in names if name in existing]
    if current in past:
        return past[: past.index(current) + 1]
    return [*past, current] if current else past


def remove_old(robots: list[str]) -> None:
    """Remove all releases but the last ones and those that run, and environments that no release of a robot needs."""
    units = system.read_units(robots)
    for robot in robots:
        used = {*history(robot)[-MAX_RELEASES:], units[robot].running}
        for name in complete_folders(releases_folder(robot)):
            if name not in used:
                shutil.rmtree(releases_folder(robot) / name, ignore_errors=True)
    linked = {
        link.readlink().name
        for robot in deployed_robots()
        for release in complete_folders(releases_folder(robot))
        for link in (releases_folder(robot) / release).iterdir()
        if link.is_symlink()
    }
    for name in complete_folders(environment_folder("x").parent):
        if name not in linked:
            shutil.rmtree(environment_folder(name), ignore_errors=True)


def deployed_robots() -> list[str]:
    """Return all robots with releases on this host, those of other fleets, too."""
    return [path.name for path in root().iterdir() if (path / "releases").is_dir()] if root().is_dir() else []


def try_connection(address: str, port: int, timeout_s: float) -> str:
    """Connect to a TCP address; return the fault, or ""."""
    try:
        socket.create_connection((address, port), timeout_s).close()
    except OSError as error:
        return error.strerror or str(error)
    return ""


HANDLERS: dict[str, Callable[..., Any]] = {
    messages.ClearParts.__name__: clear_parts,
    messages.ReadInventory.__name__: system.read_inventory,
    messages.PutEnvironment.__name__: put_environment,
    messages.PutRelease.__name__: put_release,
    messages.TryRelease.__name__: try_release,
    messages.SwitchRelease.__name__: switch_release,
    messages.RollBack.__name__: roll_back,
    messages.RemoveOld.__name__: remove_old,
    messages.ReadClock.__name__: system.utc_ns,
    messages.ReadLinger.__name__: system.has_linger,
    messages.EnableLinger.__name__: system.enable_linger,
    messages.ControlUnits.__name__: system.control_units,
    messages.ReadUnits.__name__: system.read_units,
    messages.TryConnection.__name__: try_connection,
}


def serve(requests: BinaryIO, answers: BinaryIO) -> None:
    """Answer requests until they end."""
    with ExitStack() as stack:
        handlers = {**HANDLERS, messages.Lock.__name__: lambda: stack.enter_context(_locked())}
        _answer(answers, {"result": system.facts()})
        while line := requests.readline():
            fields: dict[str, Any] = json.loads(line)
            handler = handlers[fields.pop("request")]
            if "size" in fields:
                fields["archive"] = ArchiveStream(requests, fields.pop("size"))
            try:
                _answer(answers, {"result": handler(**fields)})
            except ConnectionCut:
                return
            except Refusal as refusal:
                _answer(answers, {"refused": refusal.kind, "text": refusal.text})
            except OSError as error:
                refusal = refusal_of(error)
                _answer(answers, {"refused": refusal.kind, "text": refusal.text})


def _answer(answers: BinaryIO, answer: dict[str, Any]) -> None:
    with suppress(BrokenPipeError):  # the client is gone, which the next read reports
        answers.write(json.dumps(answer, default=_fields).encode() + b"\n")
        answers.flush()


def _fields(value: object) -> dict[str, Any]:
    """Return the fields of a dataclass, for JSON."""
    if not is_dataclass(value) or isinstance(value, type):
        raise TypeError(f"expected a dataclass, got {value!r}")
    return asdict(cast("Any", value))


@contextmanager
def _locked() -> Generator[None]:
    """Lock this host; Refusal if another deployment has the lock."""
    root().mkdir(mode=0o700, exist_ok=True)
    with (root() / "lock").open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise Refusal("busy", "another deployment to this host is under way") from None
        yield


def main() -> None:
    """Serve the parent process."""
    serve(sys.stdin.buffer, sys.stdout.buffer)

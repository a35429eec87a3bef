"""Requests on standard input, an answer to each on standard output: a line of JSON each, archives right behind theirs.

It ends with the connection. What changes the host needs the lock, which one deployment has at a time. A release is
tried out, and made the current one in one step; old ones are removed.
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
from pathlib import Path
from typing import Any, BinaryIO

from swarmwire.deploy.robots.host_side import system
from swarmwire.deploy.robots.host_side.files import (
    KEPT,
    PART,
    Cut,
    Incoming,
    Refusal,
    current,
    environment,
    part_of,
    refusal_of,
    releases,
    root,
    sync_files,
    sync_folder,
    unpack_whole,
    whole_in,
    write_whole,
)
from swarmwire.deploy.robots.host_side.system import install_unit, shown

LINES = 5  # of what a failed trial printed


def clear_parts(robots: list[str]) -> None:
    """Remove what interrupted deployments left behind."""
    for folder in (environment("x").parent, *map(releases, robots)):
        for path in folder.glob(f"*{PART}"):
            shutil.rmtree(path, ignore_errors=True)


def try_out(robot: str, release: str, packages: list[str], command: list[str], timeout_s: float) -> None:
    """Run a release that is not whole yet as it would be run, though without its robot; Refusal, and it is removed."""
    part = part_of(releases(robot) / release)
    try:
        paths = os.pathsep.join(str(part / name) for name in packages)
        done = subprocess.run(
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
        if done.returncode:
            lines = (done.stderr or done.stdout).strip().splitlines()[-LINES:]
            raise Refusal("trial", "\n".join(lines) or f"ended with {done.returncode}")
    except subprocess.TimeoutExpired:
        shutil.rmtree(part, ignore_errors=True)
        raise Refusal("trial", f"takes longer than {timeout_s:g} s") from None
    except BaseException:  # an exit, too: a half-made folder is left by nobody
        shutil.rmtree(part, ignore_errors=True)
        raise


def switch(robot: str, release: str, past: list[str] | None = None) -> None:
    """Make a release the current one, from one moment to the next: what starts before has all of the old one.

    `past` are the releases that it comes after: all so far, if not given.
    """
    whole = releases(robot) / release
    part = part_of(whole)
    if whole.is_dir():
        shutil.rmtree(part, ignore_errors=True)
    else:
        part.rename(whole)
        sync_folder(whole.parent)
    install_unit(robot, release)
    past = [name for name in (history(robot) if past is None else past) if name != release]
    write_whole(root() / robot / "history", json.dumps([*past, release]))
    link = root() / robot / f"current{PART}"
    link.unlink(missing_ok=True)
    link.symlink_to(Path("releases") / release)
    link.replace(root() / robot / "current")
    sync_folder(root() / robot)


def go_back(robot: str) -> str:
    """Make the release before the current one the current one, and forget the latter; Refusal if there is none."""
    past = history(robot)
    if len(past) < 2:
        raise Refusal("first", "there is no release before the current one")
    switch(robot, past[-2], past[:-2])
    return past[-2]


def history(robot: str) -> list[str]:
    """The releases that are still there, in the order in which they became current; the current one is the last."""
    try:
        told: list[str] = json.loads((root() / robot / "history").read_text(encoding="utf-8"))
    except (OSError, ValueError):  # none yet, or of a disk that lost it: what is current is known from its link
        told = []
    now, there = current(robot), set(whole_in(releases(robot)))
    past = [name for name in told if name in there]
    if now in past:
        return past[: past.index(now) + 1]
    return [*past, now] if now else past


def tidy(robots: list[str]) -> None:
    """Remove releases but the last ones and those that run, and packages that no release of any robot needs."""
    running = {robot: known["running"] for robot, known in shown(robots).items()}
    for robot in robots:
        kept = {*history(robot)[-KEPT:], running.get(robot, "")}
        for name in whole_in(releases(robot)):
            if name not in kept:
                shutil.rmtree(releases(robot) / name, ignore_errors=True)
    needed = {
        link.readlink().name
        for robot in robots_here()
        for release in whole_in(releases(robot))
        for link in (releases(robot) / release).iterdir()
        if link.is_symlink()
    }
    for name in whole_in(environment("x").parent):
        if name not in needed:
            shutil.rmtree(environment(name), ignore_errors=True)


def robots_here() -> list[str]:
    """All robots that have releases on this host, also of other fleets."""
    return [path.name for path in root().iterdir() if (path / "releases").is_dir()] if root().is_dir() else []


def serve(requests: BinaryIO, answers: BinaryIO) -> None:
    """Answer until the requests end."""
    with ExitStack() as held:
        operations = {**OPERATIONS, "lock": lambda: held.enter_context(_locked())}
        _answer(answers, {"said": system.facts()})
        while line := requests.readline():
            request: dict[str, Any] = json.loads(line)
            if "size" in request:
                request["incoming"] = Incoming(requests, request.pop("size"))
            try:
                _answer(answers, {"said": operations[request.pop("do")](**request)})
            except Cut:
                return
            except Refusal as refusal:
                _answer(answers, {"refused": refusal.kind, "text": refusal.text})
            except OSError as error:
                refusal = refusal_of(error)
                _answer(answers, {"refused": refusal.kind, "text": refusal.text})


def _answer(answers: BinaryIO, answer: dict[str, Any]) -> None:
    with suppress(BrokenPipeError):  # whoever asked is gone, which the next read will tell
        answers.write(json.dumps(answer).encode() + b"\n")
        answers.flush()


@contextmanager
def _locked() -> Generator[None]:
    """The lock, until the requests end; Refusal if another deployment has it."""
    root().mkdir(mode=0o700, exist_ok=True)
    with (root() / "lock").open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise Refusal("busy", "another deployment to this host is under way") from None
        yield


def _put_environment(incoming: Incoming, name: str, sha256: str) -> None:
    part = unpack_whole(incoming, sha256, environment(name))
    os.sync()  # a robot that is switched off now must not have a folder of empty files
    part.rename(environment(name))


def _put_release(incoming: Incoming, robot: str, name: str, sha256: str) -> None:
    part = unpack_whole(incoming, sha256, releases(robot) / name)
    sync_files(part)


def _reach(host: str, port: int, timeout_s: float) -> str:
    """Whether something answers at an address, as seen from here: "", or what went wrong."""
    try:
        socket.create_connection((host, port), timeout_s).close()
    except OSError as error:
        return error.strerror or str(error)
    return ""


def _state(robots: list[str]) -> dict[str, Any]:
    known = system.shown(robots)
    return {robot: {**known.get(robot, {}), "current": current(robot), "status": _status(robot)} for robot in robots}


def _status(robot: str) -> dict[str, Any] | None:
    """What the robot's agent last wrote of itself; None if there is nothing."""
    try:
        return json.loads((root() / robot / "log" / f"{robot}-status.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):  # it has never run, or is just being written
        return None


OPERATIONS: dict[str, Callable[..., Any]] = {
    "clear_parts": clear_parts,
    "present": system.present,
    "put_environment": _put_environment,
    "put_release": _put_release,
    "try_out": try_out,
    "switch": switch,
    "go_back": go_back,
    "tidy": tidy,
    "utc_ns": system.utc_ns,
    "lingers": system.lingers,
    "linger": system.linger,
    "run_units": system.run_units,
    "state": _state,
    "reach": _reach,
}


def main() -> None:
    """Serve the parent process."""
    serve(sys.stdin.buffer, sys.stdout.buffer)

"""Requests on standard input, an answer to each on standard output: a line of JSON each, archives right behind theirs.

It ends with the connection. What changes the host needs the lock, which one deployment has at a time.
"""

import fcntl
import json
import os
import socket
import sys
from collections.abc import Callable, Generator
from contextlib import ExitStack, contextmanager, suppress
from typing import Any, BinaryIO

from swarmwire.deploy.fleet.host_side import releasing, system
from swarmwire.deploy.fleet.host_side.files import (
    Cut,
    Incoming,
    Refusal,
    current,
    environment,
    refusal_of,
    releases,
    root,
    sync_files,
    unpack_whole,
)


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
    "clear_parts": releasing.clear_parts,
    "present": system.present,
    "put_environment": _put_environment,
    "put_release": _put_release,
    "try_out": releasing.try_out,
    "switch": releasing.switch,
    "go_back": releasing.go_back,
    "tidy": releasing.tidy,
    "utc_ns": system.utc_ns,
    "lingers": system.lingers,
    "linger": system.linger,
    "run_units": system.run_units,
    "state": _state,
    "reach": _reach,
}


def main() -> None:
    """Serve whoever started this process."""
    serve(sys.stdin.buffer, sys.stdout.buffer)

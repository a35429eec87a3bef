"""Run a command on a robot: in its network namespace, with its host name, and for no longer than the world lives.

    python -I -S entering.py PLACE COMMAND [ARGUMENT …]

PLACE is a `Place` as JSON. The file imports nothing but the standard library, since it is a process for each command:

    this process     enters the namespaces of the world; ends when the world's process ends
    its child        process 1 of a PID namespace, so all that the command starts ends with it
    its child        the command

Robots have a view of their own of /sys, where programs look for network devices, of /proc and of /etc/hosts, as far as
the machine allows.
"""

import ctypes
import json
import os
import select
import signal
import socket
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

CLONE_NEWNS, CLONE_NEWUTS, CLONE_NEWUSER, CLONE_NEWPID, CLONE_NEWNET = (
    0x00020000,
    0x04000000,
    0x10000000,
    0x20000000,
    0x40000000,
)  # linux/sched.h
MS_BIND, MS_REC, MS_PRIVATE = 0x1000, 0x4000, 0x40000  # linux/mount.h
PR_SET_PDEATHSIG = 1  # linux/prctl.h
PR_CAP_AMBIENT, PR_CAP_AMBIENT_RAISE = 47, 2
CAPABILITY_VERSION, CAPABILITIES = 0x20080522, 64  # linux/capability.h
START_FIELD = 19  # of /proc/PID/stat after the command's name: when the process started
NOT_FOUND, NOT_ENTERED = 127, 125  # exit codes, as of shells and of containers


INTERFACES = "interfaces.json"  # in the run folder, while the run lasts: by robot its `Place` and its addresses


class Place(NamedTuple):
    """Where a command is to run."""

    pid: int  # of the world's process
    process_start: int  # of that process: another may have its number by now
    namespace: int  # descriptor of the robot's network namespace in that process
    robot: str  # its name, which becomes the host's
    hosts: str | None  # a file in place of /etc/hosts


def process_start(pid: int) -> int | None:
    """When a process started, in clock ticks since the machine did; None if there is none."""
    with suppress(OSError, ValueError, IndexError):
        return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[START_FIELD])
    return None


def command_line(place: Place, command: list[str]) -> list[str]:
    """The command that runs `command` there."""
    return [sys.executable, "-I", "-S", __file__, json.dumps(place), *command]


def main(arguments: list[str]) -> int:
    """Run the command; returns its exit code."""
    place, command = Place(*json.loads(arguments[0])), arguments[1:]
    try:
        world = os.pidfd_open(place.pid)
        if process_start(place.pid) != place.process_start:
            raise ProcessLookupError
        _enter(place)
    except ProcessLookupError:
        _complain("the run is over")
        return NOT_ENTERED
    except OSError as error:
        _complain(f"cannot enter {place.robot}: {error.strerror}")
        return NOT_ENTERED
    for ignored in (signal.SIGINT, signal.SIGQUIT):  # of the terminal: they are the command's
        signal.signal(ignored, signal.SIG_IGN)
    alive, held = os.pipe()  # `held` closes when this process ends
    child = os.fork()
    if child == 0:
        os.close(held)
        os._exit(_first_process(place, command, alive))
    os.close(alive)
    return _waited(world, child)


def _complain(text: str) -> None:
    sys.stderr.write(f"error: {text}\n")


def _enter(place: Place) -> None:
    """Join the namespaces, and make those of the command."""
    libc = ctypes.CDLL(None, use_errno=True)
    user = Path(f"/proc/{place.pid}/ns/user")
    if user.stat().st_ino != Path("/proc/self/ns/user").stat().st_ino:
        _join(libc, user, CLONE_NEWUSER)
        _keep_capabilities(libc)
    _join(libc, Path(f"/proc/{place.pid}/fd/{place.namespace}"), CLONE_NEWNET)
    _check(libc.unshare(CLONE_NEWNS | CLONE_NEWUTS | CLONE_NEWPID))
    _check(libc.mount(None, b"/", None, MS_REC | MS_PRIVATE, None))


def _join(libc: ctypes.CDLL, path: Path, kind: int) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    _check(libc.setns(descriptor, kind))
    os.close(descriptor)


def _keep_capabilities(libc: ctypes.CDLL) -> None:
    """Let the command have the capabilities of this process, though it is not root's (capabilities(7), ambient set)."""
    header, sets = (ctypes.c_uint32 * 2)(CAPABILITY_VERSION, 0), (ctypes.c_uint32 * 6)()
    _check(libc.capget(header, sets))
    for half in (0, 3):  # effective, permitted and inheritable set of the first 32, then of the others
        sets[half + 2] = sets[half + 1]
    _check(libc.capset(header, sets))
    for capability in range(CAPABILITIES):
        libc.prctl(PR_CAP_AMBIENT, PR_CAP_AMBIENT_RAISE, capability, 0, 0)  # those that there are


def _check(result: int) -> None:
    if result != 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))


def _first_process(place: Place, command: list[str], alive: int) -> int:
    """Run the command, collect the processes that it leaves behind, and return its exit code."""
    libc = ctypes.CDLL(None, use_errno=True)
    libc.prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    gone = select.poll()
    gone.register(alive, select.POLLHUP)
    if gone.poll(0):  # the parent ended before it could take this process along
        return NOT_ENTERED
    # As far as allowed: containers often hide parts of /proc, and then refuse to mount it.
    libc.mount(b"sysfs", b"/sys", b"sysfs", 0, None)
    libc.mount(b"proc", b"/proc", b"proc", 0, None)
    if place.hosts is not None:
        libc.mount(place.hosts.encode(), b"/etc/hosts", None, MS_BIND, None)
    with suppress(OSError):
        socket.sethostname(place.robot)
    program = os.fork()
    if program == 0:
        _become(command)
    while True:
        ended, status = os.wait()
        if ended == program:
            return _exit_code(status)


def _become(command: list[str]) -> Any:
    for default in (signal.SIGINT, signal.SIGQUIT, signal.SIGPIPE):
        signal.signal(default, signal.SIG_DFL)
    try:
        os.execvp(command[0], command)
    except OSError as error:
        _complain(f"{command[0]}: {error.strerror}")
        os._exit(NOT_FOUND)


def _waited(world: int, child: int) -> int:
    """Wait until the child ends, whose exit code is returned, or the world, with which it ends."""
    ends = select.poll()
    for descriptor in (world, os.pidfd_open(child)):
        ends.register(descriptor, select.POLLIN)
    if any(descriptor == world for descriptor, _ in ends.poll()):
        os.kill(child, signal.SIGKILL)
    return _exit_code(os.waitpid(child, 0)[1])


def _exit_code(status: int) -> int:
    """As shells have it: of a process that a signal ended, 128 and its number."""
    code = os.waitstatus_to_exitcode(status)
    return 128 - code if code < 0 else code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

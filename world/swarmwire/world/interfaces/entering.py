"""Run a command on a robot: in its network namespace, with its host name, until the world ends at the latest.

    python -I -S entering.py ROBOT COMMAND [ARGUMENT …]

ROBOT is a `RobotNamespace` as JSON. The file imports only the standard library, since each command starts a process:

    this process     enters the namespaces of the world; ends when the world's process ends
    its child        process 1 of a PID namespace, so that all processes of the command end with it
    its child        the command

Robots have separate views of /sys, where programs look for network devices, of /proc and of /etc/hosts, as far as the
machine allows.
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
START_FIELD = 19  # index of the process's start in /proc/PID/stat, after the command's name
NOT_FOUND, NOT_ENTERED = 127, 125  # exit codes, as of shells and of containers


INTERFACES = "interfaces.json"  # file in the folder of a present run: `RobotNamespace` and addresses of each robot


class RobotNamespace(NamedTuple):
    """The namespace of a robot, in which commands run."""

    pid: int  # number of the world's process
    process_start: int  # its start, since another process may have its number later
    namespace: int  # descriptor of the robot's network namespace in that process
    robot: str  # the robot's name, which becomes the host name
    hosts: str | None  # file that replaces /etc/hosts


def process_start(pid: int) -> int | None:
    """Return the start of a process, in clock ticks since the machine's; None if it does not exist."""
    with suppress(OSError, ValueError, IndexError):
        return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[START_FIELD])
    return None


def command_line(target: RobotNamespace, command: list[str]) -> list[str]:
    """Return the command line that runs `command` on a robot."""
    return [sys.executable, "-I", "-S", __file__, json.dumps(target), *command]


def main(arguments: list[str]) -> int:
    """Run the command, and return its exit code."""
    target, command = RobotNamespace(*json.loads(arguments[0])), arguments[1:]
    try:
        world = os.pidfd_open(target.pid)
        if process_start(target.pid) != target.process_start:
            raise ProcessLookupError
        _enter(target)
    except ProcessLookupError:
        _print_error("the run is over")
        return NOT_ENTERED
    except OSError as error:
        _print_error(f"cannot enter {target.robot}: {error.strerror}")
        return NOT_ENTERED
    for ignored in (signal.SIGINT, signal.SIGQUIT):  # the terminal sends them to the command, too
        signal.signal(ignored, signal.SIG_IGN)
    read_end, write_end = os.pipe()  # the write end closes when this process ends
    child = os.fork()
    if child == 0:
        os.close(write_end)
        os._exit(_first_process(target, command, read_end))
    os.close(read_end)
    return _wait(world, child)


def _print_error(text: str) -> None:
    sys.stderr.write(f"error: {text}\n")


def _enter(target: RobotNamespace) -> None:
    """Join the robot's namespaces, and make new ones for the command."""
    libc = ctypes.CDLL(None, use_errno=True)
    user = Path(f"/proc/{target.pid}/ns/user")
    if user.stat().st_ino != Path("/proc/self/ns/user").stat().st_ino:
        _join(libc, user, CLONE_NEWUSER)
        _keep_capabilities(libc)
    _join(libc, Path(f"/proc/{target.pid}/fd/{target.namespace}"), CLONE_NEWNET)
    _check(libc.unshare(CLONE_NEWNS | CLONE_NEWUTS | CLONE_NEWPID))
    _check(libc.mount(None, b"/", None, MS_REC | MS_PRIVATE, None))


def _join(libc: ctypes.CDLL, path: Path, kind: int) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    _check(libc.setns(descriptor, kind))
    os.close(descriptor)


def _keep_capabilities(libc: ctypes.CDLL) -> None:
    """Pass this process's capabilities to the command, which is not root's (capabilities(7), ambient set)."""
    header, sets = (ctypes.c_uint32 * 2)(CAPABILITY_VERSION, 0), (ctypes.c_uint32 * 6)()
    _check(libc.capget(header, sets))
    for half in (0, 3):  # effective, permitted and inheritable set of the first 32 capabilities, then of the others
        sets[half + 2] = sets[half + 1]
    _check(libc.capset(header, sets))
    for capability in range(CAPABILITIES):
        libc.prctl(PR_CAP_AMBIENT, PR_CAP_AMBIENT_RAISE, capability, 0, 0)  # fails for capabilities that it lacks


def _check(result: int) -> None:
    if result != 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))


def _first_process(target: RobotNamespace, command: list[str], parent_pipe: int) -> int:
    """Run the command, reap orphaned processes, and return the command's exit code."""
    libc = ctypes.CDLL(None, use_errno=True)
    libc.prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    parent_end = select.poll()
    parent_end.register(parent_pipe, select.POLLHUP)
    if parent_end.poll(0):  # the parent ended before the signal was requested
        return NOT_ENTERED
    # Failures are ignored: containers often hide parts of /proc, and then refuse to mount it.
    libc.mount(b"sysfs", b"/sys", b"sysfs", 0, None)
    libc.mount(b"proc", b"/proc", b"proc", 0, None)
    if target.hosts is not None:
        libc.mount(target.hosts.encode(), b"/etc/hosts", None, MS_BIND, None)
    with suppress(OSError):
        socket.sethostname(target.robot)
    program = os.fork()
    if program == 0:
        _execute(command)
    while True:
        ended, status = os.wait()
        if ended == program:
            return _exit_code(status)


def _execute(command: list[str]) -> Any:
    for default in (signal.SIGINT, signal.SIGQUIT, signal.SIGPIPE):
        signal.signal(default, signal.SIG_DFL)
    try:
        os.execvp(command[0], command)
    except OSError as error:
        _print_error(f"{command[0]}: {error.strerror}")
        os._exit(NOT_FOUND)


def _wait(world: int, child: int) -> int:
    """Wait until the child ends, or kill it when the world ends; return its exit code."""
    poll = select.poll()
    for descriptor in (world, os.pidfd_open(child)):
        poll.register(descriptor, select.POLLIN)
    if any(descriptor == world for descriptor, _ in poll.poll()):
        os.kill(child, signal.SIGKILL)
    return _exit_code(os.waitpid(child, 0)[1])


def _exit_code(status: int) -> int:
    """Return the exit code as shells do: 128 + the number of the signal that ended the process."""
    code = os.waitstatus_to_exitcode(status)
    return 128 - code if code < 0 else code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

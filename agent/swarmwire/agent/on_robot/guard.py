"""The guard: a small process that outlives an agent which dies or freezes, and stops the motors in its place.

It is run as a file of its own, and imports nothing but a little of Python, so that it costs a few MB. It starts the
process of the agent, whose watchdog sends a byte down a pipe several times in the time that it allows, and another
one when all is closed. If the agent's process ends without that one, or sends nothing for too long, the guard ends
it and has another process stop the motors by a connection of its own: one that stands by, since on a small computer
it takes seconds to import what that needs. All processes that the agent has started end with it: a process that it
forked could hold the only connection that the robot takes.

Termination signals are passed on; a process that does not obey in time is killed.
"""

import json
import os
import select
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress

RUNS = b"."  # heartbeat: its process runs
STOPPED = b"S"  # it runs, and its motors were stopped for good
NOTHING = b""  # no heartbeat yet, and no motor moves
CLOSED = b"E"  # the motors are off, and the driver is closed
GRACE_S = 8.0  # from the first signal to the end, within which a robot that flies lands; systemd waits longer
LEFT_S = 3.0  # from the last heartbeat to the end
GO = b"!"  # to the process that stands by
ENDED, FAILED = 0, 1  # as in settings.py
PASSED_ON = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def guard(agent: list[str], stop: list[str], silent_s: float, pipe_option: str, standby_option: str) -> int:
    """The exit code of the command `agent`, or FAILED where `stop` had to be run.

    `pipe_option` gives the agent the file descriptor for its heartbeats; after the first one, no more than
    `silent_s` may pass between two. With `standby_option`, `stop` waits for a byte, and ends without one.
    """
    beats, pipe = os.pipe()
    os.set_blocking(pipe, False)  # an agent does not wait for a guard that is frozen
    child = subprocess.Popen([*agent, pipe_option, str(pipe)], pass_fds=(pipe,), process_group=0)
    os.close(pipe)
    _pass_on_signals(child)
    standby: list[subprocess.Popen[bytes]] = []
    fault, last = _watch(beats, silent_s, lambda: standby.append(_standing_by([*stop, standby_option])))
    if fault:
        _kill(child)  # also one that is stopped
    code = child.wait()
    _kill(child)  # what it left behind
    if last == NOTHING or (last == CLOSED and not fault):
        for one in standby:
            one.kill()
            one.communicate()
        return code if code >= 0 else FAILED
    stopped = _stopped(standby, stop)
    fault = fault or f"its process ended ({_how(code)})"
    sys.stderr.write(f"guard: the agent is gone: {fault}; the motors {'were' if stopped else 'could not be'} stopped\n")
    # A service manager that restarts failed programs must not do so after an emergency stop.
    return ENDED if last == STOPPED else FAILED


def _stopped(standby: "list[subprocess.Popen[bytes]]", stop: list[str]) -> bool:
    """Whether the motors were stopped, by the process that stood by, or, if that failed, by another."""
    for one in standby:
        one.communicate(GO)
        if one.returncode == 0:
            return True
    return subprocess.run(stop, check=False).returncode == 0


def _standing_by(stop: list[str]) -> "subprocess.Popen[bytes]":
    """The process that stops the motors on request, out of reach of a terminal's signals."""
    return subprocess.Popen(stop, stdin=subprocess.PIPE, process_group=0)


def _watch(beats: int, silent_s: float, begin: Callable[[], None]) -> tuple[str, bytes]:
    """What is wrong, if the agent's process still runs, and its last heartbeat; returns at its end.

    `begin` is called when the first heartbeat comes.
    """
    last = NOTHING
    while True:
        allowed_s = {NOTHING: None, CLOSED: LEFT_S}.get(last, silent_s)
        ready, _, _ = select.select([beats], [], [], allowed_s)
        if not ready:
            left = f"it was done {allowed_s:g} s ago, and something of it still ran"
            return left if last == CLOSED else f"it has been frozen for {allowed_s:g} s", last
        received = os.read(beats, 4096)
        if not received:
            return "", last
        if last == NOTHING:
            begin()
        last = received[-1:]


def _kill(child: "subprocess.Popen[bytes]") -> None:
    """End the agent's process, if it is still there, and all that it started."""
    with suppress(ProcessLookupError, PermissionError):  # the latter where nothing but ended processes is left
        os.killpg(child.pid, signal.SIGKILL)


def _pass_on_signals(child: "subprocess.Popen[bytes]") -> None:
    """The agent has a process group of its own: what a terminal sends comes here, once."""

    def pass_on(number: int, _: object) -> None:
        child.send_signal(number)
        signal.setitimer(signal.ITIMER_REAL, GRACE_S)

    def kill(_: int, __: object) -> None:
        _kill(child)

    for number in PASSED_ON:
        signal.signal(number, pass_on)
    signal.signal(signal.SIGALRM, kill)
    signal.signal(signal.SIGTSTP, signal.SIG_IGN)  # a stopped guard protects nothing


def _how(code: int) -> str:
    return f"exit code {code}" if code >= 0 else signal.Signals(-code).name


if __name__ == "__main__":
    sys.exit(guard(**json.loads(sys.argv[1])))

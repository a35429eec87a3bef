"""The guard: a small process that outlives an agent that dies or freezes, and stops the motors in its place.

The guard runs as a stand-alone file and imports only a few modules of Python, so it costs a few MB. It starts the
agent's process, whose watchdog sends several heartbeat bytes per timeout into a pipe, and another byte when everything
is closed. If that process ends without the last byte, or sends nothing for too long, the guard kills it, and a second
process stops the motors over a separate connection. The second process stands by from the first heartbeat on, because
its imports take seconds on a small computer. All processes that the agent has started are killed as well: a forked
process could hold the only connection that the robot accepts.

The guard forwards termination signals, and kills a process that does not end in time.
"""

import json
import os
import select
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress

RUNS = b"."  # heartbeat: the process runs
STOPPED = b"S"  # heartbeat: the process runs, and an emergency stop is latched
NO_HEARTBEAT = b""  # the driver is not open yet
CLOSED = b"E"  # the motors are off, and the driver is closed
GRACE_S = 8.0  # longest time from the first signal to the end; a flying robot lands in it, and systemd waits longer
CLOSE_TIMEOUT_S = 3.0  # longest time from CLOSED to the end of the process
GO = b"!"  # request to the standby process
ENDED, FAILED = 0, 1  # same as in settings.py
FORWARDED_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def guard(agent: list[str], stop: list[str], silent_s: float, pipe_option: str, standby_option: str) -> int:
    """Run the command `agent`, and the command `stop` if it fails; return the exit code, FAILED after a stop.

    `pipe_option` passes the file descriptor for heartbeats to the agent; after the first heartbeat, at most `silent_s`
    may pass between two. With `standby_option`, `stop` waits for a byte, and ends without one.
    """
    beats, pipe = os.pipe()
    os.set_blocking(pipe, False)  # an agent does not wait for a guard that is frozen
    child = subprocess.Popen([*agent, pipe_option, str(pipe)], pass_fds=(pipe,), process_group=0)
    os.close(pipe)
    _forward_signals(child)
    standby: list[subprocess.Popen[bytes]] = []
    fault, last = _watch(beats, silent_s, lambda: standby.append(_start_standby([*stop, standby_option])))
    if fault:
        _kill(child)  # SIGKILL also ends a suspended process
    code = child.wait()
    _kill(child)  # remaining processes of its group
    if last == NO_HEARTBEAT or (last == CLOSED and not fault):
        for process in standby:
            process.kill()
            process.communicate()
        return code if code >= 0 else FAILED
    stopped = _stop_motors(standby, stop)
    fault = fault or f"its process ended ({_exit_text(code)})"
    sys.stderr.write(f"guard: the agent is gone: {fault}; the motors {'were' if stopped else 'could not be'} stopped\n")
    # A service manager that restarts failed programs must not do so after an emergency stop.
    return ENDED if last == STOPPED else FAILED


def _stop_motors(standby: "list[subprocess.Popen[bytes]]", stop: list[str]) -> bool:
    """Stop the motors by the standby process, or, if that fails, by a new one; return True if they are stopped."""
    for process in standby:
        process.communicate(GO)
        if process.returncode == 0:
            return True
    return subprocess.run(stop, check=False).returncode == 0


def _start_standby(stop: list[str]) -> "subprocess.Popen[bytes]":
    """Start the process that stops the motors on request, out of reach of a terminal's signals."""
    return subprocess.Popen(stop, stdin=subprocess.PIPE, process_group=0)


def _watch(beats: int, silent_s: float, begin: Callable[[], None]) -> tuple[str, bytes]:
    """Wait for a fault or the end of the agent's process; return the fault, empty at its end, and the last heartbeat.

    `begin` is called at the first heartbeat.
    """
    last = NO_HEARTBEAT
    while True:
        timeout_s = {NO_HEARTBEAT: None, CLOSED: CLOSE_TIMEOUT_S}.get(last, silent_s)
        ready, _, _ = select.select([beats], [], [], timeout_s)
        if not ready:
            unfinished = f"it closed {timeout_s:g} s ago, and its processes did not end"
            return unfinished if last == CLOSED else f"no heartbeat for {timeout_s:g} s", last
        received = os.read(beats, 4096)
        if not received:
            return "", last
        if last == NO_HEARTBEAT:
            begin()
        last = received[-1:]


def _kill(child: "subprocess.Popen[bytes]") -> None:
    """Kill the agent's process, if it still exists, and all processes that it started."""
    with suppress(ProcessLookupError, PermissionError):  # PermissionError: only ended processes remain
        os.killpg(child.pid, signal.SIGKILL)


def _forward_signals(child: "subprocess.Popen[bytes]") -> None:
    """Forward termination signals: the agent has its own process group, which a terminal does not signal."""

    def forward(number: int, _: object) -> None:
        child.send_signal(number)
        signal.setitimer(signal.ITIMER_REAL, GRACE_S)

    def kill(_: int, __: object) -> None:
        _kill(child)

    for number in FORWARDED_SIGNALS:
        signal.signal(number, forward)
    signal.signal(signal.SIGALRM, kill)
    signal.signal(signal.SIGTSTP, signal.SIG_IGN)  # a stopped guard protects nothing


def _exit_text(code: int) -> str:
    return f"exit code {code}" if code >= 0 else signal.Signals(-code).name


if __name__ == "__main__":
    sys.exit(guard(**json.loads(sys.argv[1])))

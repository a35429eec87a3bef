"""Rerun's own program: where it lies, a port for it, and its end."""

import os
import socket
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

LEAVE_S = 5.0  # how long it may take to end when it is told to
# Linux kills whoever asks for it (PR_SET_PDEATHSIG, 1) with its parent; if that is dead by then, nothing begins.
ASKS = (
    "import ctypes, os, sys; ctypes.CDLL(None).prctl(1, 9); "
    "os.getppid() == int(sys.argv[1]) or os._exit(1); os.execv(sys.argv[2], sys.argv[2:])"
)


def program() -> Path:
    """The viewer. Not `rerun` on the path: that is a wrapper, and ending it would leave the viewer behind."""
    import rerun_cli

    return Path(rerun_cli.__file__).with_name("rerun")


def free_port() -> int:
    """A port of this machine's loopback that is free now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def ending_with_this(command: Sequence[str]) -> list[str]:
    """The command, such that on Linux it ends with this process, also if that is killed and cannot end it."""
    if not sys.platform.startswith("linux"):
        return list(command)
    return [sys.executable, "-I", "-S", "-c", ASKS, str(os.getpid()), *command]


def end(process: subprocess.Popen[bytes]) -> None:
    """Tell the process to end, and kill it if it does not, also if it is stopped."""
    process.terminate()
    try:
        process.wait(LEAVE_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def is_open(port: int) -> bool:
    """Whether somebody listens at this port of the loopback."""
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0

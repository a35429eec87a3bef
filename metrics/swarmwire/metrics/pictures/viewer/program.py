"""Rerun's program as a child process that reaches nothing outside this machine, and that no website reaches."""

import os
import secrets
import socket
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

LEAVE_S = 5.0  # from the request to end until it is killed
# Linux kills a process with its parent after prctl(PR_SET_PDEATHSIG, SIGKILL); if the parent is dead, exit at once.
ASKS = (
    "import ctypes, os, sys; ctypes.CDLL(None).prctl(1, 9); "
    "os.getppid() == int(sys.argv[1]) or os._exit(1); os.execv(sys.argv[2], sys.argv[2:])"
)
SETTINGS = Path(__file__).with_name("settings")  # of rerun: no usage reports
CLOSED_PROXY = "http://127.0.0.1:9"  # the port for data to be discarded, where nothing listens
LOOPBACK = "127.0.0.1"


def program() -> Path:
    """The viewer. Not `rerun` on the path: that is a wrapper, and ending it would leave the viewer behind."""
    import rerun_cli

    return Path(rerun_cli.__file__).with_name("rerun")


def closed_environment() -> dict[str, str]:
    """The environment of a rerun that sends no usage reports and cannot ask whether there is a newer rerun.

    Its usage reports are off by the settings, which on Linux replace the user's and stay as they are. There is no
    setting for its other requests: a proxy that does not exist takes all of them, also the reports of a system on which
    rerun looks for its settings elsewhere.
    """
    kept = {name: value for name, value in os.environ.items() if not name.upper().endswith("_PROXY")}
    proxies = dict.fromkeys(("ALL_PROXY", "HTTPS_PROXY", "HTTP_PROXY"), CLOSED_PROXY)
    return {**kept, **proxies, "XDG_CONFIG_HOME": str(SETTINGS), "NO_COLOR": "1"}


def hidden_loopback() -> str:
    """A random address of this machine's loopback, where rerun has no door of its own.

    Rerun's port answers every request, under any host name: a website whose name leads to this machine (DNS
    rebinding) could read the run there. On Linux the loopback has 2^24 addresses, too many to be tried; elsewhere it
    has one.
    """
    if not sys.platform.startswith("linux"):
        return LOOPBACK
    return ".".join(map(str, (127, *(1 + secrets.randbelow(254) for _ in range(3)))))


def free_port(host: str = LOOPBACK) -> int:
    """A port of this address of the loopback that is free now."""
    with socket.socket() as probe:
        probe.bind((host, 0))
        port: int = probe.getsockname()[1]
        return port


def is_open(port: int, host: str = LOOPBACK) -> bool:
    """Whether a process listens at this port of the loopback."""
    with socket.socket() as probe:
        return probe.connect_ex((host, port)) == 0


def ending_with_this(command: Sequence[str]) -> list[str]:
    """The command, such that on Linux it ends with this process, also if that is killed and cannot end it."""
    if not sys.platform.startswith("linux"):
        return list(command)
    return [sys.executable, "-I", "-S", "-c", ASKS, str(os.getpid()), *command]


def end(process: subprocess.Popen[bytes]) -> None:
    """Terminate the process; kill it if it does not end, also if it is stopped."""
    process.terminate()
    try:
        process.wait(LEAVE_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()

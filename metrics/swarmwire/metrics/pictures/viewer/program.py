"""Rerun's program as a child process without access to other machines, and out of reach of websites."""

import os
import secrets
import socket
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

Target = str | Callable[[bytes], None]  # address of rerun's program, or a receiver of the recording's bytes

TERMINATE_TIMEOUT_S = 5.0
# Linux kills a process with its parent after prctl(PR_SET_PDEATHSIG, SIGKILL); if the parent is dead, exit at once.
DIE_WITH_PARENT = (
    "import ctypes, os, sys; ctypes.CDLL(None).prctl(1, 9); "
    "os.getppid() == int(sys.argv[1]) or os._exit(1); os.execv(sys.argv[2], sys.argv[2:])"
)
SETTINGS = Path(__file__).with_name("settings")  # rerun's settings without usage reports
CLOSED_PROXY = "http://127.0.0.1:9"  # the discard port, without a listener
LOOPBACK = "127.0.0.1"


def viewer_path() -> Path:
    """Return the path of the viewer. `rerun` on the PATH is a wrapper; ending it would not end the viewer."""
    import rerun_cli

    return Path(rerun_cli.__file__).with_name("rerun")


def closed_environment() -> dict[str, str]:
    """Return the environment of a rerun that neither sends usage reports nor checks for newer versions.

    Settings, which on Linux replace the user's, disable usage reports. Other requests have no setting, so they go to a
    proxy that does not exist, as do the reports of a system on which rerun looks for its settings elsewhere.
    """
    environment = {name: value for name, value in os.environ.items() if not name.upper().endswith("_PROXY")}
    proxies = dict.fromkeys(("ALL_PROXY", "HTTPS_PROXY", "HTTP_PROXY"), CLOSED_PROXY)
    return {**environment, **proxies, "XDG_CONFIG_HOME": str(SETTINGS), "NO_COLOR": "1"}


def hidden_loopback() -> str:
    """Return a random address of this machine's loopback, since rerun has no authentication.

    Rerun's port answers every request, under any host name: a website whose name resolves to this machine (DNS
    rebinding) could read the run. On Linux the loopback has 2^24 addresses, too many to try; elsewhere it has one.
    """
    if not sys.platform.startswith("linux"):
        return LOOPBACK
    return ".".join(map(str, (127, *(1 + secrets.randbelow(254) for _ in range(3)))))


def free_port(host: str = LOOPBACK) -> int:
    """Return a free port of this address of the loopback."""
    with socket.socket() as probe:
        probe.bind((host, 0))
        port: int = probe.getsockname()[1]
        return port


def is_open(port: int, host: str = LOOPBACK) -> bool:
    """Return True if a process listens at this port of the loopback."""
    with socket.socket() as probe:
        return probe.connect_ex((host, port)) == 0


def ending_with_this(command: Sequence[str]) -> list[str]:
    """Return a command that on Linux ends with this process, even if this process is killed."""
    if not sys.platform.startswith("linux"):
        return list(command)
    return [sys.executable, "-I", "-S", "-c", DIE_WITH_PARENT, str(os.getpid()), *command]


def end(process: subprocess.Popen[bytes]) -> None:
    """Terminate the process; kill it if it does not end in time."""
    process.terminate()
    try:
        process.wait(TERMINATE_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()

"""Rerun's own program: where it lies, a port for it, and its end."""

import socket
import subprocess
from pathlib import Path

LEAVE_S = 5.0  # how long it may take to end when it is told to


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

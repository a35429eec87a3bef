"""The agent host on this machine: where it meets the world, and its process."""

import os
import secrets
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Generator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from swarmwire.agent.isolation import DEFAULT_ISOLATION, Isolation
from swarmwire.comms.base.clock import WallClock, to_ns
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.wire.sessions import PRIVATE, unix_endpoint

STALE_S = 60.0  # of a socket without a listener: one that was just made may be about to
ANSWER_S = 0.5  # of the system, for the listener
SOCKET = "world"  # in a private directory


def new_run_id() -> str:
    """A unique name for one execution."""
    return secrets.token_hex(4)


@contextmanager
def local_endpoint() -> Generator[str]:
    """An endpoint in a new private directory, which is gone afterwards."""
    base = tempfile.gettempdir()
    base = base if len(base) < 60 else "/tmp"
    _remove_stale(Path(base))
    with tempfile.TemporaryDirectory(prefix=PRIVATE, dir=base) as directory:
        yield unix_endpoint(f"{directory}/{SOCKET}")


def _remove_stale(base: Path) -> None:
    """Take away the directories of this user's runs that were killed, and so could not do it themselves."""
    before_ns = WallClock().utc_ns() - to_ns(STALE_S)
    for path in base.glob(f"{PRIVATE}*/{SOCKET}"):
        with suppress(OSError):  # not this user's, or gone by now
            about = path.lstat()
            is_old = path.is_socket() and about.st_uid == os.getuid() and about.st_mtime_ns < before_ns
            if is_old and not _is_listened_at(path):
                shutil.rmtree(path.parent)


def _is_listened_at(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX) as probe:
        probe.settimeout(ANSWER_S)
        try:
            probe.connect(str(path))
        except ConnectionRefusedError:
            return False
        except (TimeoutError, BlockingIOError):  # it is frozen, and many have called
            return True
        return True


def check_isolation(isolation: Isolation, runners: int) -> None:
    """BadInput if agents in so many processes cannot be isolated so."""
    if not isolation.strict:
        return
    if not runners:
        raise BadInput("--isolate", "", "expected --runners with it: agents in this process are not isolated")
    command = [sys.executable, "-m", FORK_SERVER, *isolation.arguments]
    tried = subprocess.run(command, capture_output=True, text=True, check=False, env=_environment())
    if tried.returncode:
        raise BadInput("--isolate", "", tried.stderr.strip().splitlines()[-1])


def _environment() -> dict[str, str]:
    """What this process can import, its agent host can; one BLAS thread, since idle threads double its memory."""
    path = os.pathsep.join(filter(None, sys.path))
    return {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": path}


LEAVE_S = 3.0
FORK_SERVER = "swarmwire.agent.fork_server"  # the program that tries an isolation
AGENT_HOST = "swarmwire.agent.agent_host"  # the program


class RunnerProcesses:
    """The agent host of a run and its processes; none of them outlives `stop` or this process."""

    def __init__(
        self,
        endpoint: str,
        run_id: str,
        agents: Sequence[str],
        processes: int,
        *,
        name: str = "host",
        waited_for: bool = False,
        isolation: Isolation = DEFAULT_ISOLATION,
    ) -> None:
        """`waited_for` says whether the world waits for each answer, so that nothing is gained by a quick start."""
        command = [sys.executable, "-m", AGENT_HOST, endpoint, run_id, ",".join(agents), name, str(processes)]
        command += isolation.arguments
        # A session of its own: Ctrl-C is for the world alone, and the whole group can be ended at once.
        self._agent_host = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=2,  # prints of agents are no result of this process
            start_new_session=True,
            env=_environment(),
        )
        if waited_for and hasattr(os, "SCHED_BATCH"):
            # Hundreds of processes on a few cores then take turns, and do not break off one another as each is asked:
            # a tenth less of processor time. The agent host's children have it from the agent host.
            with suppress(OSError):
                os.sched_setscheduler(self._agent_host.pid, os.SCHED_BATCH, os.sched_param(0))

    def trouble(self) -> str | None:
        """That the agent host ended early, in words; None while all is well."""
        if self._agent_host.poll() is None:
            return None
        return f"the agent host ended early (exit code {self._agent_host.returncode})"

    def stop(self) -> None:
        """Wait a moment for the host to leave, then end all that are left."""
        with suppress(subprocess.TimeoutExpired):
            self._agent_host.wait(LEAVE_S)
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._agent_host.pid, signal.SIGKILL)
        self._agent_host.wait()
        if self._agent_host.stdin is not None:
            self._agent_host.stdin.close()

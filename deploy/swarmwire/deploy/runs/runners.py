"""The agent host of a run on this machine: its process, and the check of its isolation."""

import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress

from swarmwire.agent.isolation import Isolation
from swarmwire.comms.base.errors import BadInput

STOP_TIMEOUT_S = 3.0
FORK_SERVER = "swarmwire.agent.fork_server"  # program that tries an isolation
AGENT_HOST = "swarmwire.agent.agent_host"  # program of the agent host


def check_isolation(isolation: Isolation) -> None:
    """Raise BadInput if this machine cannot isolate agents' processes."""
    command = [sys.executable, "-m", FORK_SERVER, *isolation.arguments]
    trial = subprocess.run(command, capture_output=True, text=True, check=False, env=_environment())
    if trial.returncode:
        raise BadInput("isolate", "", trial.stderr.strip().splitlines()[-1])


def _environment() -> dict[str, str]:
    """Return the environment of the agent host.

    It imports from the paths of this process, and has one BLAS thread, since idle threads double its memory.
    """
    path = os.pathsep.join(filter(None, sys.path))
    return {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": path}


class RunnerProcesses:
    """The agent host of a run and its processes, which end at the latest with this process."""

    def __init__(
        self,
        endpoint: str,
        run_id: str,
        agents: Sequence[str],
        processes: int,
        *,
        is_lockstep: bool,
        isolation: Isolation,
    ) -> None:
        """Start the agent host; `is_lockstep`: the world waits for each answer."""
        command = [sys.executable, "-m", AGENT_HOST, endpoint, run_id, ",".join(agents), "host", str(processes)]
        command += isolation.arguments
        # In a session of its own it does not receive Ctrl-C, and its group of processes can be ended at once.
        self._agent_host = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=2,  # standard error: prints of agents are no result of this process
            start_new_session=True,
            env=_environment(),
        )
        if is_lockstep and hasattr(os, "SCHED_BATCH"):
            # Hundreds of processes on a few cores then do not preempt one another at each frame, which saves a tenth
            # of the processor time. The agent host's children inherit the policy.
            with suppress(OSError):
                os.sched_setscheduler(self._agent_host.pid, os.SCHED_BATCH, os.sched_param(0))

    def failure(self) -> str | None:
        """Return a message if the agent host ended early; None while it runs."""
        if self._agent_host.poll() is None:
            return None
        return f"the agent host ended early (exit code {self._agent_host.returncode})"

    def stop(self) -> None:
        """Wait a moment for the agent host to leave, then end its processes."""
        with suppress(subprocess.TimeoutExpired):
            self._agent_host.wait(STOP_TIMEOUT_S)
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._agent_host.pid, signal.SIGKILL)
        self._agent_host.wait()
        if self._agent_host.stdin is not None:
            self._agent_host.stdin.close()

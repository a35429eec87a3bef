"""Runners as processes of this machine: an agent host that forks them, watched and ended with the run."""

import os
import selectors
import signal
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress

LEAVE_S = 3.0


class RunnerProcesses:
    """The processes of all runners of one run; none of them outlives `stop` or this process."""

    program = "swarmwire.agent.agent_host"  # that forks them

    def __init__(
        self, endpoint: str, run_id: str, agents: Sequence[str], names: Sequence[str], *, waited_for: bool = False
    ) -> None:
        """`waited_for` says whether the world waits for each answer, so that nothing is gained by a quick start."""
        command = [sys.executable, "-m", self.program, endpoint, run_id, ",".join(agents), *names]
        # A session of its own: Ctrl-C is for the world alone, and the whole group can be ended at once. One BLAS
        # thread: a runner's arrays are small, idle threads double its memory. What this process can import, they can.
        self._agent_host = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        )
        if waited_for and hasattr(os, "SCHED_BATCH"):
            # Hundreds of processes on a few cores then take turns, and do not break off one another as each is asked:
            # a tenth less of processor time. The agent host's children have it from the agent host.
            with suppress(OSError):
                os.sched_setscheduler(self._agent_host.pid, os.SCHED_BATCH, os.sched_param(0))
        self._reports = selectors.DefaultSelector()
        if self._agent_host.stdout is not None:
            self._reports.register(self._agent_host.stdout, selectors.EVENT_READ)

    def trouble(self) -> str | None:
        """What happened to a runner that ended badly, in words; None while all is well."""
        if self._agent_host.poll() is not None:
            return f"the runners' processes ended early (exit code {self._agent_host.returncode})"
        stdout = self._agent_host.stdout
        if stdout is not None and self._reports.select(timeout=0):
            name, _, code = stdout.readline().decode().strip().partition(" ")
            return f"the process of runner {name} ended with exit code {code}"
        return None

    def stop(self) -> None:
        """Wait a moment for the runners to leave, then end those that are left."""
        self._reports.close()
        with suppress(subprocess.TimeoutExpired):
            self._agent_host.wait(LEAVE_S)
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._agent_host.pid, signal.SIGKILL)
        self._agent_host.wait()
        for stream in (self._agent_host.stdin, self._agent_host.stdout):
            if stream is not None:
                stream.close()

"""The borders of agent processes: limits of an agent's code beyond the socket to its host.

The fork server enters the borders that all processes share before it imports an agent, each process the others before
it gets its robots. `docs/distributed.md` lists them. This module imports nothing of zenoh.
"""

import os
import select
import signal
import tempfile
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from swarmwire.agent.system_calls import (
    CLONE_NEWNET,
    CLONE_NEWNS,
    CLONE_NEWPID,
    LANDLOCK_WITH_SCOPES,
    MAX_NAME,
    MS_NODEV,
    MS_NOEXEC,
    MS_NOSUID,
    MS_PRIVATE,
    MS_RDONLY,
    MS_REC,
    PR_SET_CHILD_SUBREAPER,
    PR_SET_NAME,
    PR_SET_NO_NEW_PRIVS,
    PR_SET_PDEATHSIG,
    SCOPE_ABSTRACT_SOCKETS,
    SCOPE_SIGNAL,
    check,
    drop_capabilities,
    enter_file_system,
    enter_landlock,
    landlock_version,
    libc,
    mount,
    namespaces_fault,
    refuse_sockets,
    set_dumpable,
)

OOM_SCORE = "500"  # under memory pressure, the system ends an agent process rather than the world
SOCKETS = "sw-*"  # folders with a socket of a run: `PRIVATE` of `comms.wire.sessions`, which imports zenoh


class IsolationFailed(Exception):
    """This system does not allow `--isolate`; the text is an expectation, as in `BadInput`."""


@dataclass(frozen=True)
class Isolation:
    """The borders of the agent processes of a host.

    Attributes:
        network: agents may use the network.
        strict: `--isolate`: also namespaces for processes and files.
        hidden: folders that a strict process does not see, besides those with sockets and control files of runs.
    """

    network: bool = False
    strict: bool = False
    hidden: tuple[str, ...] = ()

    @property
    def shares_code(self) -> bool:
        """True if the fork server imports agents: then their code runs in it and can reach all processes."""
        return not self.strict

    @property
    def arguments(self) -> list[str]:
        """The isolation as arguments of the agent host's program; `in_arguments` reads them."""
        flags = ["--agent-network"] * self.network + ["--isolate"] * self.strict
        return [*flags, *(f"--hide={folder}" for folder in self.hidden)]

    @classmethod
    def in_arguments(cls, arguments: list[str]) -> "Isolation":
        """Return the isolation in these arguments."""
        hidden = tuple(text.removeprefix("--hide=") for text in arguments if text.startswith("--hide="))
        return cls("--agent-network" in arguments, "--isolate" in arguments, hidden)

    def enter_server(self) -> list[str]:
        """Enter the borders that all processes share; return those that the system does not allow, a line each.

        A strict server continues in a child of this process, which waits for it. IsolationFailed if that is impossible.
        """
        namespaces = (0 if self.network else CLONE_NEWNET) | (CLONE_NEWNS | CLONE_NEWPID if self.strict else 0)
        fault = namespaces_fault(namespaces) if namespaces else None
        if self.strict:
            try:
                if fault:
                    raise fault
                self._hide_folders()
                _continue_in_child()
                self._try_process()
            except OSError as error:
                raise IsolationFailed(_expectation(error)) from error
        set_dumpable(allowed=False)
        filter_fault = None if self.strict else self._drop_rights()
        missing: list[str] = []
        if fault and filter_fault:
            missing.append(f"agents may use the network ({fault.strerror}, {filter_fault.strerror})")
        if not landlock_version() and (fault or not namespaces) and os.geteuid():
            missing.append("agents may read the memory of your other programs: expected Linux with Landlock")
        if landlock_version() < LANDLOCK_WITH_SCOPES:
            missing.append("agents may send signals to your other programs: expected Linux 6.12 with Landlock")
        return missing

    def fork(self, server: int) -> int:
        """Fork a process, a strict one as the first of a process namespace. `server` is the pidfd of this process."""
        if not self.strict:
            return os.fork()
        check(libc().unshare(CLONE_NEWPID))
        pid = os.fork()
        if pid:
            check(libc().setns(server, CLONE_NEWPID))
        return pid

    def enter_process(self) -> None:
        """Enter the borders of this process alone."""
        set_dumpable(allowed=True)  # otherwise root owns the file below
        with suppress(OSError):
            Path("/proc/self/oom_score_adj").write_text(OOM_SCORE)
        set_dumpable(allowed=False)
        if self.strict:
            enter_file_system()
            self._drop_rights()
        enter_landlock(SCOPE_SIGNAL | (0 if self.network else SCOPE_ABSTRACT_SOCKETS))

    def _try_process(self) -> None:
        """Enter the borders of a process in a trial process; OSError if the system does not allow them."""
        server = os.pidfd_open(os.getpid())
        child = self.fork(server)
        if child == 0:
            try:
                self.enter_process()
            except OSError as error:
                os._exit(error.errno or 1)
            os._exit(0)
        os.close(server)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        if code:
            raise OSError(code, os.strerror(abs(code)))

    def _hide_folders(self) -> None:
        mount(None, "/", None, MS_REC | MS_PRIVATE)
        for folder in (*self.hidden, *_private_folders()):
            with suppress(FileNotFoundError):
                mount("tmpfs", str(folder), "tmpfs", MS_RDONLY | MS_NOSUID | MS_NODEV | MS_NOEXEC, "size=4k")

    def _drop_rights(self) -> OSError | None:
        """Drop privileges for good; refuse sockets unless agents may use the network; return the error of a failure."""
        drop_capabilities()
        check(libc().prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0))
        try:
            if not self.network:
                refuse_sockets()
        except OSError as error:
            return error
        return None


DEFAULT_ISOLATION = Isolation()


def end_with_parent(parent: int) -> None:
    """End this process with its parent; close `parent`, a file of pidfd_open."""
    libc().prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    ended = select.poll()
    ended.register(parent, select.POLLIN)
    if ended.poll(0):  # the parent ended before
        os._exit(1)
    os.close(parent)


def name_process(name: str) -> None:
    """Name this process in `ps` and `top`; of a long name they show the end, which has the robot's number."""
    check(libc().prctl(PR_SET_NAME, name.encode()[-MAX_NAME:], 0, 0, 0))


def adopt_orphans() -> None:
    """Become the parent of processes that children of this process leave behind."""
    check(libc().prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0))


def keep_from_others() -> None:
    """Keep other processes of this user from reading this one's memory."""
    set_dumpable(allowed=False)


def _private_folders() -> list[Path]:
    """Return the folders with sockets and control files of this user's runs on this machine."""
    temporary, runtime = Path(tempfile.gettempdir()), os.environ.get("XDG_RUNTIME_DIR")
    folders = [*temporary.glob(SOCKETS), temporary / f"swarmwire-{os.geteuid()}"]
    return [*folders, Path(runtime, "swarmwire")] if runtime else folders


def _continue_in_child() -> None:
    """Continue in a child, which is in the new process namespace; this process waits, with all files closed."""
    parent = os.pidfd_open(os.getpid())
    child = os.fork()
    if child == 0:
        end_with_parent(parent)
        return
    os.closerange(3, 1 << 16)
    os.waitpid(child, 0)
    os._exit(0)


def _expectation(error: OSError) -> str:
    fix = "sudo sysctl kernel.unprivileged_userns_clone=1 kernel.apparmor_restrict_unprivileged_userns=0"
    return f"expected root, or rights to make namespaces ({error.strerror}): {fix}"

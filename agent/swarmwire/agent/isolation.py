"""The borders of agent processes: what an agent's code reaches beyond the socket to its host.

The fork server enters the borders that all processes share before it imports an agent, each process the others before
it gets its robots. `docs/processes.md` lists them. This module has no other use of the network, and none of zenoh.
"""

import ctypes
import errno
import os
import platform
import select
import signal
import tempfile
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from struct import pack

CLONE_NEWNS, CLONE_NEWIPC, CLONE_NEWUSER, CLONE_NEWPID, CLONE_NEWNET = (
    0x00020000,
    0x08000000,
    0x10000000,
    0x20000000,
    0x40000000,
)  # linux/sched.h
MS_RDONLY, MS_NOSUID, MS_NODEV, MS_NOEXEC, MS_REC, MS_PRIVATE = 1, 2, 4, 8, 0x4000, 0x40000  # linux/mount.h
MOUNT_ATTR_RDONLY, AT_RECURSIVE, AT_FDCWD = 1, 0x8000, -100  # linux/mount.h, fcntl.h
PR_SET_PDEATHSIG, PR_SET_DUMPABLE, PR_SET_NAME, PR_SET_SECCOMP = 1, 4, 15, 22  # linux/prctl.h
PR_SET_CHILD_SUBREAPER, PR_SET_NO_NEW_PRIVS = 36, 38
MAX_NAME = 15  # bytes of a process's name
CAPABILITY_VERSION = 0x20080522  # linux/capability.h
SECCOMP_MODE_FILTER, SECCOMP_RET_ALLOW, SECCOMP_RET_ERRNO = 2, 0x7FFF0000, 0x00050000  # linux/seccomp.h
BPF_LOAD, BPF_AND, BPF_JEQ, BPF_JGE, BPF_RETURN = 0x20, 0x54, 0x15, 0x35, 0x06  # linux/bpf_common.h
ALLOW, REFUSE = (BPF_RETURN, SECCOMP_RET_ALLOW), (BPF_RETURN, SECCOMP_RET_ERRNO | errno.EACCES)
NUMBER_AT, ARCHITECTURE_AT, TYPE_AT = 0, 4, 24  # in seccomp_data; the last: low half of the second argument
OTHER_ABI = 0x40000000  # system calls of x32, and none of other machines
SOCK_DGRAM, SOCK_TYPE_MASK = 2, 0xF
# Of each machine: its number in linux/audit.h, and the system calls socket, connect, socketpair in asm/unistd.h.
MACHINES = {"x86_64": (0xC000003E, 41, 42, 53), "aarch64": (0xC00000B7, 198, 203, 199)}
# The same on all machines.
SYS_IO_URING_SETUP, SYS_MOUNT_SETATTR, SYS_LANDLOCK_CREATE, SYS_LANDLOCK_RESTRICT = 425, 442, 444, 446
LANDLOCK_VERSION, LANDLOCK_MAKE_BLOCK, SCOPE_ABSTRACT_SOCKETS, SCOPE_SIGNAL = 1, 1 << 11, 1, 2  # linux/landlock.h
LANDLOCK_WITH_SCOPES = 6  # version
OOM_SCORE = "500"  # without memory, the system ends an agent process and not the world
SOCKETS = "sw-*"  # folders with a socket of a run: `PRIVATE` of `comms.wire.sessions`, which imports zenoh
SCRATCH = "/dev/shm"


class IsolationFailed(Exception):
    """This system does not allow what `--isolate` needs; the text is an expectation, as of `BadInput`."""


@dataclass(frozen=True)
class Isolation:
    """The borders of the agent processes of a host.

    Attributes:
        network: whether agents may use the network.
        strict: `--isolate`: also namespaces for processes and files.
        hidden: folders that a strict process does not see, beside those with sockets and control files of runs.
    """

    network: bool = False
    strict: bool = False
    hidden: tuple[str, ...] = ()

    @property
    def shares_code(self) -> bool:
        """Whether the fork server imports agents: their code then runs in it, with a hold on all processes."""
        return not self.strict

    @property
    def arguments(self) -> list[str]:
        """The isolation as arguments of the agent host's program; `in_arguments` reads them."""
        flags = ["--agent-network"] * self.network + ["--isolate"] * self.strict
        return [*flags, *(f"--hide={folder}" for folder in self.hidden)]

    @classmethod
    def in_arguments(cls, arguments: list[str]) -> "Isolation":
        """The isolation in arguments."""
        hidden = tuple(of.removeprefix("--hide=") for of in arguments if of.startswith("--hide="))
        return cls("--agent-network" in arguments, "--isolate" in arguments, hidden)

    def enter_server(self) -> list[str]:
        """Enter what all processes share; returns borders that the system does not allow, a line each.

        A strict server continues in a child of this process, which waits for it. IsolationFailed if it cannot be so.
        """
        namespaces = (0 if self.network else CLONE_NEWNET) | (CLONE_NEWNS | CLONE_NEWPID if self.strict else 0)
        fault = _namespaces_fault(namespaces) if namespaces else None
        if self.strict:
            try:
                if fault:
                    raise fault
                self._hide_folders()
                _continue_in_child()
                self._try_process()
            except OSError as error:
                raise IsolationFailed(_expectation(error)) from error
        _set_dumpable(allowed=False)
        filter_fault = None if self.strict else self._enter_rest()
        missing: list[str] = []
        if fault and filter_fault:
            missing.append(f"agents may use the network ({fault.strerror}, {filter_fault.strerror})")
        if not _landlock_version() and (fault or not namespaces) and os.geteuid():
            missing.append("agents may read the memory of your other programs: expected Linux with Landlock")
        if _landlock_version() < LANDLOCK_WITH_SCOPES:
            missing.append("agents may send signals to your other programs: expected Linux 6.12 with Landlock")
        return missing

    def fork(self, server: int) -> int:
        """Fork a process; if this is strict, as the first of a process namespace. `server` is this one's pidfd."""
        if not self.strict:
            return os.fork()
        _check(_libc().unshare(CLONE_NEWPID))
        pid = os.fork()
        if pid:
            _check(_libc().setns(server, CLONE_NEWPID))
        return pid

    def enter_process(self) -> None:
        """Enter the borders of this process alone."""
        _set_dumpable(allowed=True)  # or the file below is root's
        with suppress(OSError):
            Path("/proc/self/oom_score_adj").write_text(OOM_SCORE)
        _set_dumpable(allowed=False)
        if self.strict:
            _enter_file_system()
            self._enter_rest()
        _enter_landlock(SCOPE_SIGNAL | (0 if self.network else SCOPE_ABSTRACT_SOCKETS))

    def _try_process(self) -> None:
        """Enter the borders of a process in one that ends; OSError if the system does not allow it."""
        server = os.pidfd_open(os.getpid())
        child = self.fork(server)
        if child == 0:
            try:
                self.enter_process()
            except OSError as error:
                os._exit(error.errno or 1)
            os._exit(0)
        os.close(server)
        number = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        if number:
            raise OSError(number, os.strerror(abs(number)))

    def _hide_folders(self) -> None:
        _mount(None, "/", None, MS_REC | MS_PRIVATE)
        for folder in (*self.hidden, *_private_folders()):
            with suppress(FileNotFoundError):
                _mount("tmpfs", str(folder), "tmpfs", MS_RDONLY | MS_NOSUID | MS_NODEV | MS_NOEXEC, "size=4k")

    def _enter_rest(self) -> OSError | None:
        """Drop privileges for good and, unless agents may use the network, refuse new sockets: why not, if it fails."""
        _drop_capabilities()
        _check(_libc().prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0))
        try:
            if not self.network:
                _refuse_sockets()
        except OSError as error:
            return error
        return None


DEFAULT_ISOLATION = Isolation()


def end_with_parent(parent: int) -> None:
    """End this process with its parent, of which this is a file (pidfd_open); closes the file."""
    _libc().prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    ended = select.poll()
    ended.register(parent, select.POLLIN)
    if ended.poll(0):  # it ended before
        os._exit(1)
    os.close(parent)


def name_process(name: str) -> None:
    """Name this process in `ps` and `top`: by the end of the name, which has the robot's number, if it is too long."""
    _check(_libc().prctl(PR_SET_NAME, name.encode()[-MAX_NAME:], 0, 0, 0))


def adopt_orphans() -> None:
    """Become the parent of what children of this process leave behind."""
    _check(_libc().prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0))


def keep_from_others() -> None:
    """Keep other processes of this user from reading this one's memory."""
    _set_dumpable(allowed=False)


@cache
def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None, use_errno=True)


def _check(result: int) -> int:
    if result < 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return result


def _set_dumpable(*, allowed: bool) -> None:
    _check(_libc().prctl(PR_SET_DUMPABLE, int(allowed), 0, 0, 0))


def _namespaces_fault(namespaces: int) -> OSError | None:
    """Enter new namespaces; returns why the system does not allow it, if it does not."""
    try:
        _enter_namespaces(namespaces)
    except OSError as error:
        return error
    return None


def _enter_namespaces(namespaces: int) -> None:
    """Enter new namespaces; without root in a user namespace, in which the user is the same."""
    user, group = os.geteuid(), os.getegid()
    if user == 0:
        _check(_libc().unshare(namespaces))
        return
    _check(_libc().unshare(namespaces | CLONE_NEWUSER))
    Path("/proc/self/setgroups").write_text("deny")
    Path("/proc/self/uid_map").write_text(f"{user} {user} 1")
    Path("/proc/self/gid_map").write_text(f"{group} {group} 1")


def _private_folders() -> list[Path]:
    """The folders with sockets and control files of this user's runs on this machine."""
    temporary, runtime = Path(tempfile.gettempdir()), os.environ.get("XDG_RUNTIME_DIR")
    folders = [*temporary.glob(SOCKETS), temporary / f"swarmwire-{os.geteuid()}"]
    return [*folders, Path(runtime, "swarmwire")] if runtime else folders


def _continue_in_child() -> None:
    """Continue in a child, which is in the new process namespace; this process waits, and holds nothing."""
    parent = os.pidfd_open(os.getpid())
    child = os.fork()
    if child == 0:
        end_with_parent(parent)
        return
    os.closerange(3, 1 << 16)
    os.waitpid(child, 0)
    os._exit(0)


def _mount(source: str | None, target: str, kind: str | None, flags: int, options: str | None = None) -> None:
    names = (text.encode() if text else None for text in (source, target, kind))
    _check(_libc().mount(*names, flags, options.encode() if options else None))


def _enter_file_system() -> None:
    """Make all files read-only, except scratch files, and /proc that of this process alone."""
    _check(_libc().unshare(CLONE_NEWNS | CLONE_NEWIPC))
    read_only = ctypes.create_string_buffer(pack("<4Q", MOUNT_ATTR_RDONLY, 0, 0, 0))
    _check(_libc().syscall(SYS_MOUNT_SETATTR, AT_FDCWD, b"/", AT_RECURSIVE, read_only, len(read_only) - 1))
    closed = MS_NOSUID | MS_NODEV | MS_NOEXEC
    _mount("proc", "/proc", "proc", MS_RDONLY | closed)
    _mount("tmpfs", SCRATCH, "tmpfs", closed, "size=64m,mode=1777")
    os.environ["TMPDIR"] = SCRATCH


def _drop_capabilities() -> None:
    """Drop all rights of root beyond its files."""
    header = (ctypes.c_uint32 * 2)(CAPABILITY_VERSION, 0)
    _check(_libc().capset(header, (ctypes.c_uint32 * 6)()))


def _refuse_sockets() -> None:
    """Refuse sockets to other programs from now on, also by the path of a unix socket; pairs of sockets are allowed."""
    machine = MACHINES.get(platform.machine())
    if machine is None:
        raise OSError(errno.ENOSYS, f"no filter for {platform.machine()}")
    architecture, opens, connects, pairs = machine
    program = [
        *((BPF_LOAD, ARCHITECTURE_AT), (BPF_JEQ, architecture, 1, 0), REFUSE),
        *((BPF_LOAD, NUMBER_AT), (BPF_JGE, OTHER_ABI, 0, 1), REFUSE),
        *(step for number in (opens, connects, SYS_IO_URING_SETUP) for step in ((BPF_JEQ, number, 0, 1), REFUSE)),
        *((BPF_JEQ, pairs, 1, 0), ALLOW),
        *((BPF_LOAD, TYPE_AT), (BPF_AND, SOCK_TYPE_MASK), (BPF_JEQ, SOCK_DGRAM, 1, 0), ALLOW, REFUSE),
    ]
    steps = b"".join(pack("<HBBI", code, *(jumps or (0, 0)), k) for code, k, *jumps in program)
    data = ctypes.create_string_buffer(steps)
    pointer = pack("@HP", len(program), ctypes.addressof(data))
    _check(_libc().prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, ctypes.create_string_buffer(pointer), 0, 0))


@cache
def _landlock_version() -> int:
    """The version of Landlock of this system; 0 if it has none."""
    return max(0, _libc().syscall(SYS_LANDLOCK_CREATE, None, 0, LANDLOCK_VERSION))


def _enter_landlock(scopes: int) -> None:
    """Let this process trace and signal only what it starts itself, as far as the system has Landlock."""
    version = _landlock_version()
    if not version:
        return
    # A rule set needs a right that it handles: that to make block devices, which agents have no use for.
    rules = pack("<3Q", LANDLOCK_MAKE_BLOCK, 0, scopes)[: 24 if version >= LANDLOCK_WITH_SCOPES else 8]
    file = _check(_libc().syscall(SYS_LANDLOCK_CREATE, ctypes.create_string_buffer(rules), len(rules), 0))
    _check(_libc().syscall(SYS_LANDLOCK_RESTRICT, file, 0))
    os.close(file)


def _expectation(error: OSError) -> str:
    fix = "sudo sysctl kernel.unprivileged_userns_clone=1 kernel.apparmor_restrict_unprivileged_userns=0"
    return f"expected root, or rights to make namespaces ({error.strerror}): {fix}"

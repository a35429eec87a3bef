"""System calls of Linux that close borders around a process: namespaces, mounts, a filter of calls, Landlock.

Python has no functions for them, so they are called through the C library. They raise OSError if the system refuses.
"""

import ctypes
import errno
import os
import platform
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
MAX_NAME = 15  # bytes in the name of a process
CAPABILITY_VERSION = 0x20080522  # linux/capability.h
SECCOMP_MODE_FILTER, SECCOMP_RET_ALLOW, SECCOMP_RET_ERRNO = 2, 0x7FFF0000, 0x00050000  # linux/seccomp.h
BPF_LOAD, BPF_AND, BPF_JEQ, BPF_JGE, BPF_RETURN = 0x20, 0x54, 0x15, 0x35, 0x06  # linux/bpf_common.h
ALLOW, REFUSE = (BPF_RETURN, SECCOMP_RET_ALLOW), (BPF_RETURN, SECCOMP_RET_ERRNO | errno.EACCES)
NUMBER_OFFSET, ARCHITECTURE_OFFSET, TYPE_OFFSET = 0, 4, 24  # in seccomp_data; the type is the low half of argument 2
OTHER_ABI = 0x40000000  # first system call of x32; on other machines there is none
SOCK_DGRAM, SOCK_TYPE_MASK = 2, 0xF
# Number of each machine in linux/audit.h, and of its system calls socket, connect, socketpair in asm/unistd.h.
MACHINES = {"x86_64": (0xC000003E, 41, 42, 53), "aarch64": (0xC00000B7, 198, 203, 199)}
# System calls with the same number on all machines.
SYS_IO_URING_SETUP, SYS_MOUNT_SETATTR, SYS_LANDLOCK_CREATE, SYS_LANDLOCK_RESTRICT = 425, 442, 444, 446
LANDLOCK_VERSION, LANDLOCK_MAKE_BLOCK, SCOPE_ABSTRACT_SOCKETS, SCOPE_SIGNAL = 1, 1 << 11, 1, 2  # linux/landlock.h
LANDLOCK_WITH_SCOPES = 6  # version
SCRATCH = "/dev/shm"


@cache
def libc() -> ctypes.CDLL:
    """Load the C library."""
    return ctypes.CDLL(None, use_errno=True)


def check(result: int) -> int:
    """Return the result of a call; OSError if it is negative."""
    if result < 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return result


def set_dumpable(*, allowed: bool) -> None:
    """Allow or forbid other processes of this user to read the memory of this process."""
    check(libc().prctl(PR_SET_DUMPABLE, int(allowed), 0, 0, 0))


def namespaces_fault(namespaces: int) -> OSError | None:
    """Enter new namespaces; return the error if the system does not allow it."""
    try:
        enter_namespaces(namespaces)
    except OSError as error:
        return error
    return None


def enter_namespaces(namespaces: int) -> None:
    """Enter new namespaces; without root also a user namespace with the same user."""
    user, group = os.geteuid(), os.getegid()
    if user == 0:
        check(libc().unshare(namespaces))
        return
    check(libc().unshare(namespaces | CLONE_NEWUSER))
    Path("/proc/self/setgroups").write_text("deny")
    Path("/proc/self/uid_map").write_text(f"{user} {user} 1")
    Path("/proc/self/gid_map").write_text(f"{group} {group} 1")


def mount(source: str | None, target: str, kind: str | None, flags: int, options: str | None = None) -> None:
    """Mount a file system."""
    names = (text.encode() if text else None for text in (source, target, kind))
    check(libc().mount(*names, flags, options.encode() if options else None))


def enter_file_system() -> None:
    """Make all files read-only, except scratch files, and mount a /proc of this process namespace alone."""
    check(libc().unshare(CLONE_NEWNS | CLONE_NEWIPC))
    read_only = ctypes.create_string_buffer(pack("<4Q", MOUNT_ATTR_RDONLY, 0, 0, 0))
    check(libc().syscall(SYS_MOUNT_SETATTR, AT_FDCWD, b"/", AT_RECURSIVE, read_only, len(read_only) - 1))
    closed = MS_NOSUID | MS_NODEV | MS_NOEXEC
    mount("proc", "/proc", "proc", MS_RDONLY | closed)
    mount("tmpfs", SCRATCH, "tmpfs", closed, "size=64m,mode=1777")
    os.environ["TMPDIR"] = SCRATCH


def drop_capabilities() -> None:
    """Drop all rights of root, except those of its files."""
    header = (ctypes.c_uint32 * 2)(CAPABILITY_VERSION, 0)
    check(libc().capset(header, (ctypes.c_uint32 * 6)()))


def refuse_sockets() -> None:
    """Refuse sockets to other programs from now on, also by the path of a unix socket; pairs of sockets are allowed."""
    machine = MACHINES.get(platform.machine())
    if machine is None:
        raise OSError(errno.ENOSYS, f"no filter for {platform.machine()}")
    architecture, sys_socket, sys_connect, sys_socketpair = machine
    program = [
        *((BPF_LOAD, ARCHITECTURE_OFFSET), (BPF_JEQ, architecture, 1, 0), REFUSE),
        *((BPF_LOAD, NUMBER_OFFSET), (BPF_JGE, OTHER_ABI, 0, 1), REFUSE),
        *(
            step
            for number in (sys_socket, sys_connect, SYS_IO_URING_SETUP)
            for step in ((BPF_JEQ, number, 0, 1), REFUSE)
        ),
        *((BPF_JEQ, sys_socketpair, 1, 0), ALLOW),
        *((BPF_LOAD, TYPE_OFFSET), (BPF_AND, SOCK_TYPE_MASK), (BPF_JEQ, SOCK_DGRAM, 1, 0), ALLOW, REFUSE),
    ]
    steps = b"".join(pack("<HBBI", code, *(jumps or (0, 0)), k) for code, k, *jumps in program)
    data = ctypes.create_string_buffer(steps)
    pointer = pack("@HP", len(program), ctypes.addressof(data))
    check(libc().prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, ctypes.create_string_buffer(pointer), 0, 0))


@cache
def landlock_version() -> int:
    """Return the version of Landlock of this system; 0 without Landlock."""
    return max(0, libc().syscall(SYS_LANDLOCK_CREATE, None, 0, LANDLOCK_VERSION))


def enter_landlock(scopes: int) -> None:
    """Let this process trace and signal only processes that it starts itself, if the system has Landlock."""
    version = landlock_version()
    if not version:
        return
    # A rule set must handle a right: this one handles making block devices, which agents do not need.
    rules = pack("<3Q", LANDLOCK_MAKE_BLOCK, 0, scopes)[: 24 if version >= LANDLOCK_WITH_SCOPES else 8]
    file = check(libc().syscall(SYS_LANDLOCK_CREATE, ctypes.create_string_buffer(rules), len(rules), 0))
    check(libc().syscall(SYS_LANDLOCK_RESTRICT, file, 0))
    os.close(file)

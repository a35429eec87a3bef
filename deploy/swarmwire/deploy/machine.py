"""The machine of a run: a cache for kernels, memory, files, threads, messages for its errors, paths of programs."""

import atexit
import ctypes
import errno
import os
import resource
import shutil
import sys
import tempfile
import threading
from _thread import LockType, allocate_lock, start_new_thread
from pathlib import Path
from typing import Any

from swarmwire.comms.base.errors import BadInput

KERNEL_CACHE = "NUMBA_CACHE_DIR"
CODE = Path(__file__).parent

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD, M_ARENA_MAX = -1, -3, -8  # parameters of mallopt, from glibc's malloc.h
MAX_CACHED_ARRAY_BYTES = 2**25  # glibc's maximum on 64 bits; larger arrays return to the system at once
MAX_CACHED_BYTES = 2**28
HEAPS = 2  # the main thread's, and one for all others

WORLD_FILES = 100  # open files of a world with its tables and observers; 40 were counted without observers
WORLD_THREADS = 40  # threads of a world with runners on two cores, besides those of its libraries
THREADS_PER_CORE = 2
THREADS_PER_RUNNER = 4  # three of the runner's process, and less than one of the world's
SMALL_STACK_BYTES = 1 << 18
WORLD_ADDRESS_BYTES = 4_000_000_000  # 3.5 GB were counted, most of it reserved by libraries and never used

HINTS = {
    errno.ENOSPC: "make room: df -h",
    errno.EDQUOT: "make room: quota",
    errno.EFBIG: "raise the limit: ulimit -f",
    errno.EMFILE: "raise the limit: ulimit -n",
    errno.ENFILE: "raise the limit of the system: fs.file-max",
    errno.ENOMEM: "fewer robots, seeds or runners need less",
    errno.EAGAIN: "raise the limit of processes and threads, ulimit -u, or of memory, ulimit -v",
    errno.EROFS: "choose another folder",
    errno.EIO: "the disk may be worn out",
}
NO_THREAD = "can't start new thread"  # message of Python's threads
NO_SEGMENT = "failed to map segment"  # message of the dynamic linker, in an ImportError


def keep_kernels() -> None:
    """Make sure that there is a folder for compiled kernels, before a module with kernels is imported.

    numba writes them next to the code, else to the user's cache, and fails if it can write to neither: in a container
    without a home, or with a full or read-only disk. There this makes a temporary folder for the life of the process.
    """
    if KERNEL_CACHE in os.environ or os.access(CODE, os.W_OK):
        return
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser())
    try:
        (home / "numba").mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError):  # RuntimeError: there is no home
        os.environ[KERNEL_CACHE] = tempfile.mkdtemp(prefix="sw-kernels-")  # inherited by child processes
        atexit.register(shutil.rmtree, os.environ[KERNEL_CACHE], ignore_errors=True)


def share_heaps() -> None:
    """Make all threads allocate from two heaps; no effect once there are more, or without glibc.

    By default each thread allocates from a heap of its own, up to eight per core. A world of many threads would grow
    for hours, until each heap has had the largest tables.
    """
    _mallopt({M_ARENA_MAX: HEAPS})


def keep_memory() -> None:
    """Make the C library cache up to 256 MB of freed memory; no effect without glibc.

    Tables of a tick are allocated again in the next. By default arrays of 128 kB and more return to the system at once,
    which must clear each page before the process may use it again: a third of a tick with a busy radio.
    """
    _mallopt({M_MMAP_THRESHOLD: MAX_CACHED_ARRAY_BYTES, M_TRIM_THRESHOLD: MAX_CACHED_BYTES})


def return_memory() -> None:
    """Return the C library's free memory to the system, in 1 to 3 ms; no effect without glibc."""
    if (malloc_trim := _glibc_function("malloc_trim")) is not None:
        malloc_trim(0)


def _mallopt(parameters: dict[int, int]) -> None:
    if (mallopt := _glibc_function("mallopt")) is not None:
        for parameter, value in parameters.items():
            mallopt(parameter, value)


def _glibc_function(name: str) -> Any:
    """Return a function of the C library; None if it does not exist."""
    return getattr(ctypes.CDLL(None), name, None) if sys.platform == "linux" else None


def need_open_files(runners: int) -> None:
    """Raise this process's limit of open files for a world of this number of runners; BadInput without the right.

    If a limit is reached during a run, libraries end the process, or hang.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    needed = WORLD_FILES + runners  # one link per runner
    if soft == resource.RLIM_INFINITY or soft >= needed:
        return
    try:
        resource.setrlimit(resource.RLIMIT_NOFILE, (needed, hard))
    except (ValueError, OSError):
        raise _too_small(runners, f"a limit of at least {needed} open files", hard, "ulimit -n") from None


def need_address_space() -> None:
    """Raise BadInput if this process may not have the address space of a run.

    If it runs out, libraries end the process, or hang.
    """
    limit_bytes = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit_bytes != resource.RLIM_INFINITY and limit_bytes < WORLD_ADDRESS_BYTES:
        expected = f"a limit of at least {WORLD_ADDRESS_BYTES // 1000} kB of address space"
        raise BadInput("this machine", "", f"expected {expected} for a run, got {limit_bytes // 1000} (ulimit -v)")


def need_threads(runners: int) -> None:
    """Raise BadInput if a world of this number of runners may not have its threads and processes.

    The limits of the user, the container, the system and the memory apply, so the threads are started, and ended at
    once.
    """
    needed = WORLD_THREADS + THREADS_PER_CORE * (os.cpu_count() or 1) + THREADS_PER_RUNNER * runners
    stack_bytes, gate, started = threading.stack_size(SMALL_STACK_BYTES), allocate_lock(), 0
    try:
        with gate:
            while started < needed:
                start_new_thread(_wait_for, (gate,))
                started += 1
    except RuntimeError:
        hint = "ulimit -u, or the container's limit of pids"
        raise _too_small(runners, f"room for {needed} more threads and processes", started, hint) from None
    finally:
        threading.stack_size(stack_bytes)


def _wait_for(gate: LockType) -> None:
    with gate:
        pass


def _too_small(runners: int, expected: str, got: int, hint: str) -> BadInput:
    return BadInput("this machine", "", f"expected {expected} for {runners} runners, got {got} ({hint})")


def refusal(error: BaseException) -> str | None:
    """Return a line with a remedy for an error of the machine (disk, files, memory, processes); None for others."""
    if isinstance(error, MemoryError):
        is_limited = resource.getrlimit(resource.RLIMIT_AS)[0] != resource.RLIM_INFINITY
        hint = "raise the limit: ulimit -v" if is_limited else HINTS[errno.ENOMEM]
        return f"no memory is left: {error}".removesuffix(": ") + f" ({hint})"
    if isinstance(error, ImportError) and NO_SEGMENT in str(error):
        return f"no memory is left to load {Path(error.path or '').name or 'a library'} (raise the limit: ulimit -v)"
    if isinstance(error, RuntimeError) and NO_THREAD in str(error):
        return f"no thread can be started ({HINTS[errno.EAGAIN]})"
    if isinstance(error, OSError) and error.errno in HINTS:
        file = f"{error.filename}: " if error.filename else ""
        return f"{file}{error.strerror} ({HINTS[error.errno]})"
    return None


def command_path(name: str = "swarmwire") -> Path:
    """Return a program of swarmwire as users can type it: its name, or its path if their PATH does not lead to it."""
    present = Path(sys.argv[0])
    path = present.with_name(name)
    if present.name != "swarmwire" or not path.exists():  # started by python -m or another program
        return Path(name)
    if (on_path := shutil.which(name)) and Path(on_path).samefile(path):
        return Path(name)
    return path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path

"""What a run needs of its machine: a cache for kernels, memory, files, threads; its errors and programs in words."""

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
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swarmwire.comms.base.errors import BadInput

if TYPE_CHECKING:
    from rich.console import Console

KERNEL_CACHE = "NUMBA_CACHE_DIR"
CODE = Path(__file__).parent
COMPILING_S = 2.0  # of compiling, before a line about it
COMPILING_AGAIN_S = 10.0  # from one line to the next
COMPILING = "compiling kernels that this machine does not have yet: for a minute or so, then they are kept"

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD, M_ARENA_MAX = -1, -3, -8  # of mallopt, as in glibc's malloc.h
LARGEST_KEPT_BYTES = 2**25  # the most that glibc takes on 64 bits; larger arrays go back as ever
KEPT_BYTES = 2**28
HEAPS = 2  # the main thread's, and one for all others

OWN_FILES = 100  # of a world, its tables, and its observers; 40 were counted before anybody looked on
OWN_THREADS = 40  # of a world with runners on two cores, beside those that its libraries have already
THREADS_PER_CORE = 2
THREADS_PER_RUNNER = 4  # three of the runner's process, and less than one here
SMALL_STACK_BYTES = 1 << 18
OWN_ADDRESS_BYTES = 4_000_000_000  # of a world; 3.5 GB were counted, most of it reserved by libraries and never used

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
NO_THREAD = "can't start new thread"  # of Python's threads
NO_SEGMENT = "failed to map segment"  # of the dynamic linker, as an ImportError


def keep_kernels() -> None:
    """Make a place for compiled kernels, before anything is imported that has kernels.

    numba keeps them beside the code, else in the user's cache, and refuses to work where neither can be written: a
    container without a home, or with a disk that is full or read-only. There they live as long as this process.
    """
    if KERNEL_CACHE in os.environ or os.access(CODE, os.W_OK):
        return
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser())
    try:
        (home / "numba").mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError):  # there may be no home
        os.environ[KERNEL_CACHE] = tempfile.mkdtemp(prefix="sw-kernels-")  # also for processes that this one starts
        atexit.register(shutil.rmtree, os.environ[KERNEL_CACHE], ignore_errors=True)


@contextmanager
def report_compiling(
    console: "Console", after_s: float = COMPILING_S, again_s: float = COMPILING_AGAIN_S
) -> Generator[None]:
    """Print a line if kernels are compiled within the context for so long, then how many so far each `again_s`."""
    from swarmwire.comms.base.clock import WallClock, to_s
    from swarmwire.comms.base.kernels import compile_events

    class Compiling:
        is_compiling = False
        kernels = 0
        left_s = after_s  # of compiling, before the next line
        printed = False

        def on_start(self, depth: int) -> None:
            with lock:
                self.kernels += 1
                if depth == 0:
                    self.is_compiling = True
                    self.wait()

        def on_end(self, depth: int) -> None:
            with lock:
                if depth == 0:
                    self.is_compiling = False
                    self.timer.cancel()
                    self.left_s -= to_s(clock.now_ns() - self.began_ns)
                    if self.left_s <= 0:
                        self.print_line()

        def wait(self) -> None:
            self.began_ns, self.timer = clock.now_ns(), threading.Timer(self.left_s, self.print_meanwhile)
            self.timer.daemon = True
            self.timer.start()

        def print_meanwhile(self) -> None:
            with lock:
                if self.is_compiling and self.timer is threading.current_thread():  # else it was too late to cancel it
                    self.print_line()
                    self.wait()

        def print_line(self) -> None:
            console.print(
                f"{self.kernels} kernels so far" if self.printed else COMPILING, soft_wrap=True, highlight=False
            )
            self.printed, self.left_s = True, again_s

    clock, lock, compiling = WallClock(), threading.Lock(), Compiling()
    with compile_events(compiling.on_start, compiling.on_end):
        yield


def share_heaps() -> None:
    """Have all threads take memory from two heaps; without effect once there are more, and where it is not glibc.

    By default each thread takes from a heap of its own, up to eight a core. A world of many threads would grow for
    hours, until each heap has had the largest tables.
    """
    _mallopt({M_ARENA_MAX: HEAPS})


def keep_memory() -> None:
    """Let the C library keep what is freed, up to 256 MB; without effect where it is not glibc.

    Tables of a tick are allocated again in the next. By default memory of 128 kB and more goes back to the system at
    once, which must clear each page before the process may use it again: a third of a tick with a busy radio.
    """
    _mallopt({M_MMAP_THRESHOLD: LARGEST_KEPT_BYTES, M_TRIM_THRESHOLD: KEPT_BYTES})


def return_memory() -> None:
    """Give what the C library keeps back to the system, in 1 to 3 ms; without effect where it is not glibc."""
    if (malloc_trim := _of_glibc("malloc_trim")) is not None:
        malloc_trim(0)


def _mallopt(parameters: dict[int, int]) -> None:
    if (mallopt := _of_glibc("mallopt")) is not None:
        for parameter, value in parameters.items():
            mallopt(parameter, value)


def _of_glibc(name: str) -> Any:
    """A function of the C library; None if it has none of this name."""
    return getattr(ctypes.CDLL(None), name, None) if sys.platform == "linux" else None


def need_open_files(runners: int) -> None:
    """Raise the limit of this process to that of a world of so many runners; BadInput if that is not allowed.

    Where a limit is reached in the middle of a run, libraries below end the process, or hang.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    needed = OWN_FILES + runners  # each has a link
    if soft == resource.RLIM_INFINITY or soft >= needed:
        return
    try:
        resource.setrlimit(resource.RLIMIT_NOFILE, (needed, hard))
    except (ValueError, OSError):
        raise _limited(runners, f"a limit of at least {needed} open files", hard, "ulimit -n") from None


def need_address_space() -> None:
    """Return if this process may have the addresses of a run; else BadInput.

    Where they run out, libraries below end the process, or hang.
    """
    limit_bytes = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit_bytes != resource.RLIM_INFINITY and limit_bytes < OWN_ADDRESS_BYTES:
        expected = f"a limit of at least {OWN_ADDRESS_BYTES // 1000} kB of address space"
        raise BadInput("this machine", "", f"expected {expected} for a run, got {limit_bytes // 1000} (ulimit -v)")


def need_threads(runners: int) -> None:
    """Return if a world of so many runners may have its threads and processes; else BadInput.

    They are limited for a user, a container, the system, and by memory. So they are started, and ended at once.
    """
    needed = OWN_THREADS + THREADS_PER_CORE * (os.cpu_count() or 1) + THREADS_PER_RUNNER * runners
    before, gate, started = threading.stack_size(SMALL_STACK_BYTES), allocate_lock(), 0
    try:
        with gate:
            while started < needed:
                start_new_thread(_wait_for, (gate,))
                started += 1
    except RuntimeError:
        hint = "ulimit -u, or the container's limit of pids"
        raise _limited(runners, f"room for {needed} more threads and processes", started, hint) from None
    finally:
        threading.stack_size(before)


def _wait_for(gate: LockType) -> None:
    with gate:
        pass


def _limited(runners: int, expected: str, got: int, hint: str) -> BadInput:
    return BadInput("this machine", "", f"expected {expected} for {runners} runners, got {got} ({hint})")


def refusal(error: BaseException) -> str | None:
    """An error of the machine (disk, files, memory, processes) in a line, with a remedy; None for any other error."""
    if isinstance(error, MemoryError):
        return f"no memory is left: {error}".removesuffix(": ") + f" ({HINTS[errno.ENOMEM]})"
    if isinstance(error, ImportError) and NO_SEGMENT in str(error):
        return f"no memory is left to load {Path(error.path or '').name or 'a library'} (raise the limit: ulimit -v)"
    if isinstance(error, RuntimeError) and NO_THREAD in str(error):
        return f"no thread can be started ({HINTS[errno.EAGAIN]})"
    if isinstance(error, OSError) and error.errno in HINTS:
        where = f"{error.filename}: " if error.filename else ""
        return f"{where}{error.strerror} ({HINTS[error.errno]})"
    return None


def program(name: str = "swarmwire") -> Path:
    """A program beside this one, as people can type it here: it need not be on their path, as with `uv run`."""
    called = Path(sys.argv[0])
    beside = called.with_name(name)
    if called.name != "swarmwire" or not beside.exists():  # python -m, a program of others
        return Path(name)
    return beside.relative_to(Path.cwd()) if beside.is_relative_to(Path.cwd()) else beside

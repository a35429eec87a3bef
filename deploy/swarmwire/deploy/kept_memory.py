"""Memory of large arrays stays with the process.

Tables of a tick are made anew in the next. By default the C library gives memory of 128 kB and more back to the system
at once, which must clear each page before the process may use it again: a third of a tick with a busy radio.

What is kept is kept by heap, and each thread takes from a heap of its own, up to eight a core. A world of many threads
would grow for hours, until each heap has had the largest tables.
"""

import ctypes
import sys

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD, M_ARENA_MAX = -1, -3, -8  # of mallopt, as in glibc's malloc.h
LARGEST_KEPT_BYTES = 2**25  # the most that glibc takes on 64 bits; larger arrays go back as ever
KEPT_BYTES = 2**28
HEAPS = 2  # the main thread's, and one for all others


def share_heaps() -> None:
    """Have all threads take memory from two heaps; without effect once there are more, and where it is not glibc."""
    _mallopt({M_ARENA_MAX: HEAPS})


def keep_memory() -> None:
    """Let the C library keep what is freed, up to 256 MB; without effect where it is not glibc."""
    _mallopt({M_MMAP_THRESHOLD: LARGEST_KEPT_BYTES, M_TRIM_THRESHOLD: KEPT_BYTES})


def _mallopt(parameters: dict[int, int]) -> None:
    if sys.platform != "linux":
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        for parameter, value in parameters.items():
            mallopt(parameter, value)

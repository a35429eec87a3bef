"""Memory of large arrays stays with the process.

Tables of a tick are made anew in the next. By default the C library gives memory of 128 kB and more back to the system
at once, which must clear each page before the process may use it again: a third of a tick with a busy radio.
"""

import ctypes
import sys

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3  # of mallopt, as in glibc's malloc.h
LARGEST_KEPT_BYTES = 2**25  # the most that glibc takes on 64 bits; larger arrays go back as ever
KEPT_BYTES = 2**28


def keep_memory() -> None:
    """Let the C library keep what is freed, up to 256 MB; without effect where it is not glibc."""
    if sys.platform != "linux":
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(M_MMAP_THRESHOLD, LARGEST_KEPT_BYTES)
        mallopt(M_TRIM_THRESHOLD, KEPT_BYTES)

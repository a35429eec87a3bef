"""Threads share the heaps of the C library, counted as it tells them itself."""

import ctypes
import subprocess
import sys

import pytest

THREADS = 6
PROGRAM = f"""
import ctypes, threading
from swarmwire.deploy.host import share_heaps
SHARED
met, gone = threading.Barrier({THREADS + 1}), threading.Barrier({THREADS + 1})
libc = ctypes.CDLL(None)
libc.malloc.restype, libc.malloc.argtypes = ctypes.c_void_p, [ctypes.c_size_t]
libc.fopen.restype = ctypes.c_void_p
def take():
    met.wait()
    assert libc.malloc(100_000)
    gone.wait()
for _ in range({THREADS}):
    threading.Thread(target=take).start()
met.wait()
gone.wait()
file = libc.fopen(b"/dev/stdout", b"w")
libc.malloc_info(0, ctypes.c_void_p(file))
libc.fflush(ctypes.c_void_p(file))
"""


def heaps(first: str) -> int:
    """How many heaps a process has whose threads all took memory at the same time."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.replace("SHARED", first)], capture_output=True, text=True, check=True, timeout=60
    )
    return done.stdout.count("<heap nr=")


@pytest.mark.skipif(
    not hasattr(ctypes.CDLL(None), "malloc_info"), reason="only glibc, whose heaps these are, tells how many there are"
)
def test_threads_share_two_heaps() -> None:
    assert heaps("share_heaps()") == 2 < heaps("")

"""The end of a process whose sessions are still closing, which zenoh may take ten seconds for.

Python must not be torn down meanwhile: a thread that comes back from zenoh then finds no interpreter, and the process
aborts ("exception not rethrown"). So the end waits for such threads, or is made at once by `end_now`.
"""

import atexit
import os
import sys
import threading

LONGEST_S = 12.0  # after ten seconds zenoh gives up

_left: list[threading.Thread] = []


def left_closing(closing: threading.Thread) -> None:
    """A thread that goes on closing a session, for which nobody waits but the end of the process."""
    _left.append(closing)
    atexit.register(closing.join, LONGEST_S)


def end_now(code: int) -> None:
    """End this process if a session is still closing, with nothing more done; else return. For the end of programs."""
    if any(closing.is_alive() for closing in _left):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)

"""The end of a process whose zenoh sessions are still closing. Programs import this module before they need zenoh.

Python must not be torn down while a thread closes a session: a thread that returns from zenoh would find no
interpreter, and the process would abort ("exception not rethrown"). Therefore the process waits for such threads at its
end, or `end_now` ends it at once.
"""

import atexit
import os
import sys
import threading

MAX_CLOSE_S = 12.0  # zenoh gives up after ten seconds

_closing_threads: list[threading.Thread] = []


def wait_at_exit(closing: threading.Thread) -> None:
    """Wait, at the end of the process, for a thread that still closes a session."""
    _closing_threads.append(closing)
    atexit.register(closing.join, MAX_CLOSE_S)


def end_now(code: int) -> None:
    """End this process at once if a session is still closing; otherwise return. Programs call it last."""
    if any(closing.is_alive() for closing in _closing_threads):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)

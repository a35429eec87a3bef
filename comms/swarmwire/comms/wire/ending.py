"""The end of a process whose zenoh sessions are still closing. Programs import it before they need zenoh.

While a thread closes a session, Python must not be torn down: a thread that returns from zenoh would find no
interpreter, and the process would abort ("exception not rethrown"). So the end of the process waits for such threads,
or `end_now` ends it at once.
"""

import atexit
import os
import sys
import threading

MAX_CLOSE_S = 12.0  # after ten seconds zenoh gives up

_closing_threads: list[threading.Thread] = []


def wait_at_exit(closing: threading.Thread) -> None:
    """Let the end of the process wait for a thread that still closes a session."""
    _closing_threads.append(closing)
    atexit.register(closing.join, MAX_CLOSE_S)


def end_now(code: int) -> None:
    """End this process at once if a session is still closing; else return. Programs call it last."""
    if any(closing.is_alive() for closing in _closing_threads):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)

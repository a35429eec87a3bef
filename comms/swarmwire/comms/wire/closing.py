"""Closing zenoh sessions, which may wait ten seconds for a peer that is frozen, out of reach, or about to close, too.

zenoh then raises "close operation timed out" (its issue 2675). Nothing is lost by that: the session is of no use any
more, and all that it holds ends with the process.
"""

# zenoh's stubs leave out the return type of close.
# pyright: reportUnknownMemberType=false

import logging
import threading
from collections.abc import Generator
from contextlib import contextmanager

import zenoh

from swarmwire.comms.wire.ending import left_closing

PATIENCE_S = 1.0  # whoever is well answers in milliseconds

log = logging.getLogger(__name__)


def close_session(session: zenoh.Session, patience_s: float = PATIENCE_S) -> None:
    """Close a session, waiting no longer than so for those who do not answer; safe to call again."""
    closing = threading.Thread(target=_close, args=(session,), name="closing", daemon=True)
    closing.start()
    closing.join(patience_s)
    if closing.is_alive():
        left_closing(closing)


@contextmanager
def closed_after(session: zenoh.Session) -> Generator[zenoh.Session]:
    """The session, closed with the context."""
    try:
        yield session
    finally:
        close_session(session)


def _close(session: zenoh.Session) -> None:
    try:
        session.close()
    except zenoh.ZError as error:
        log.info("a session was left to the end of the process: %s", error)

"""A session is closed without a wait for those who do not answer, and without an error of theirs."""

from threading import Event

import zenoh

from swarmwire.comms.wire.closing import close_session, closed_after
from tests.support.swarms import peers


class Stuck:
    """A session that zenoh cannot close in time."""

    def __init__(self, wait: Event | None = None) -> None:
        self._wait = wait

    def close(self) -> None:
        if self._wait is not None:
            self._wait.wait()
        raise zenoh.ZError("close operation timed out!")


def test_a_session_is_closed_and_may_be_closed_again():
    with peers(1) as (session,), closed_after(session):
        close_session(session)
        assert session.is_closed()


def test_what_cannot_be_closed_in_time_is_left_to_the_end_of_the_process(caplog):
    caplog.set_level("INFO")
    with closed_after(Stuck()):
        pass
    assert "left to the end of the process" in caplog.text
    wait = Event()
    close_session(Stuck(wait), patience_s=0.01)
    wait.set()

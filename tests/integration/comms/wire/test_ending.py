"""A process whose session is still closing ends all the same: with its exit code, and without an abort."""

import subprocess
import sys

from swarmwire.comms.wire import ending
from swarmwire.comms.wire.ending import end_now

# A session whose close takes long, as on a machine that is busy.
PROGRAM = """
import atexit, sys, threading
from swarmwire.comms.wire import ending
from swarmwire.comms.wire.closing import close_session

class Slow:
    def __init__(self): self.closed, self.may = False, threading.Event()
    def close(self):
        self.may.wait()
        self.closed = True

session = Slow()
close_session(session, patience_s=0.01)
print("done")
"""
WAITS = "atexit.register(lambda: print('closed' if session.closed else 'open')); "


def ended(program: str) -> tuple[int, str, str]:
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    return done.returncode, done.stdout, done.stderr


def test_where_nothing_is_closing_it_returns(monkeypatch):
    monkeypatch.setattr(ending, "_left", [])
    end_now(3)


def test_a_program_ends_at_once_with_its_exit_code():
    assert ended(PROGRAM + "ending.end_now(3); sys.exit(4)") == (3, "done\n", "")


def test_once_all_is_closed_it_ends_as_usual():
    closed = "session.may.set(); ending._left[0].join(); "
    assert ended(PROGRAM + closed + "ending.end_now(3); sys.exit(4)") == (4, "done\n", "")


def test_else_python_waits_for_what_still_closes():
    # What is registered first is called last: by then the session is closed, or the wait was in vain.
    program = PROGRAM.replace("session = Slow()", "session = Slow()\n" + WAITS)
    end = "threading.Timer(0.05, session.may.set).start(); sys.exit(4)"
    assert ended(program + end) == (4, "done\nclosed\n", "")

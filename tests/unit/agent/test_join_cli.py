"""`swarmwire-agent join` leaves a run in order when a signal comes, however it was started."""

import os
import signal
from typing import Any

import pytest

from swarmwire.agent import joining
from swarmwire.agent.joining import Joining
from swarmwire.agent.on_robot.settings import INTERRUPTED
from swarmwire.agent.runner import Ended, TickInbox


@pytest.mark.parametrize("interrupt", [signal.SIG_IGN, signal.default_int_handler], ids=["in background", "in front"])
def test_a_signal_leaves_the_run_and_is_what_it_was_afterwards(monkeypatch, capsys, interrupt: Any) -> None:
    def killed(_joining: Joining, inbox: TickInbox, _say: Any) -> Ended:
        os.kill(os.getpid(), signal.SIGTERM)
        return Ended("left" if inbox._arrived.get(timeout=10.0) is None else "gone")

    monkeypatch.setattr("swarmwire.agent.joining.join", killed)
    before, ended_by = signal.signal(signal.SIGINT, interrupt), signal.getsignal(signal.SIGTERM)
    try:
        assert joining.join_and_report(Joining("tcp/127.0.0.1:1")) == INTERRUPTED
        assert signal.getsignal(signal.SIGINT) is interrupt
        assert signal.getsignal(signal.SIGTERM) is ended_by
    finally:
        signal.signal(signal.SIGINT, before)
    assert "left the run" in capsys.readouterr().err

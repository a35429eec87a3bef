"""`swarmwire-agent join` leaves a run in order when a signal comes, however it was started."""

import os
import signal
from typing import Any, cast

import pytest

from swarmwire.agent import join_command
from swarmwire.agent.joining import JoinSettings
from swarmwire.agent.on_robot.settings import INTERRUPTED
from swarmwire.agent.runner import Arrivals
from swarmwire.agent.runner_protocol import Ended, RunnerProtocol


@pytest.mark.parametrize("interrupt", [signal.SIG_IGN, signal.default_int_handler], ids=["in background", "in front"])
def test_a_signal_leaves_the_run_and_is_what_it_was_afterwards(monkeypatch, capsys, interrupt: Any) -> None:
    def killed(_settings: JoinSettings, arrivals: Arrivals, _say: Any) -> Ended:
        os.kill(os.getpid(), signal.SIGTERM)
        protocol = RunnerProtocol()
        arrivals.pass_on(protocol, timeout_s=10.0)
        return cast("Ended", protocol.next_event())

    monkeypatch.setattr("swarmwire.agent.joining.join", killed)
    before, ended_by = signal.signal(signal.SIGINT, interrupt), signal.getsignal(signal.SIGTERM)
    try:
        assert join_command.join_and_report(JoinSettings("tcp/127.0.0.1:1")) == INTERRUPTED
        assert signal.getsignal(signal.SIGINT) is interrupt
        assert signal.getsignal(signal.SIGTERM) is ended_by
    finally:
        signal.signal(signal.SIGINT, before)
    assert "left the run" in capsys.readouterr().err

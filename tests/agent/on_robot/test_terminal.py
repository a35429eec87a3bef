"""Whoever reads what a robot's agent tells may leave: the agent goes on."""

import os
import sys

from swarmwire.agent.on_robot.terminal import Terminal


def test_a_terminal_that_is_gone_stops_nobody_not_even_at_the_end(monkeypatch):
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "w") as out:
        monkeypatch.setattr(sys, "stdout", out)
        monkeypatch.setattr(sys, "stderr", out)
        terminal = Terminal("robot-0")
        terminal.begin("what runs")
        terminal.say("something")
    terminal.say("to a file that is closed")

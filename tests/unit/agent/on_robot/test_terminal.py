"""Whoever reads what a robot's agent tells may leave: the agent goes on."""

import os
import sys

import pytest

from swarmwire.agent.on_robot.terminal import Terminal, short


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


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({}, "running, tick 600"),
        ({"agent_state": "search"}, "running, tick 600, search"),
        ({"late_ticks": 2}, "running, tick 600, 2 late"),
        ({"charge": 0.5}, "running, tick 600, battery 50 %"),
    ],
)
def test_a_status_is_a_line_of_what_there_is_to_tell(change, told):
    assert (
        short({"state": "running", "tick": 600, "agent_state": "", "late_ticks": 0, "charge": None, **change}) == told
    )

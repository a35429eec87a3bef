"""How work on robots is shown, and what is said where it cannot begin."""

import io

import pytest
from rich.console import Console

from swarmwire.comms.errors import Interrupted
from swarmwire.deploy.cli.robots import act
from swarmwire.deploy.fleet.result import HostFailed, Nothing, Result, result_lines, shown_on


def test_without_the_extra_a_line_says_what_to_install(fleet, robots, monkeypatch):
    fleet.add("flock-0")
    monkeypatch.setattr("swarmwire.comms.extras.find_spec", lambda name: None if name == "asyncssh" else name)
    code, (line,) = robots("status")
    assert (code, "swarmwire[fleet]" in line) == (2, True)


def test_a_line_per_robot_has_the_cause_and_the_cure_whatever_they_look_like():
    failed = Result.failed("b", HostFailed("two\n lines", "mend it"))
    assert result_lines([Result("long-name", True, "done"), failed]) == [
        "long-name  done",
        "b          failed: two lines; mend it",
    ]


def test_in_a_terminal_each_robot_has_a_bar_until_it_is_through():
    screen = io.StringIO()
    with shown_on(Console(file=screen, force_terminal=True, width=100, _environ={"TERM": "xterm"})) as watcher:
        watcher.step("flock-0", "packages", 5_000_000, 10_000_000)
        watcher.step("flock-1", "trial run")
        watcher.end(Result("flock-0", True, "done"))
        watcher.end(Result("flock-2", True, "never began"))
    shown = screen.getvalue()
    assert "flock-1" in shown
    assert "trial run" in shown


def test_elsewhere_nothing_is_drawn():
    assert isinstance(shown_on(Console(file=io.StringIO())), Nothing)


def test_ctrl_c_ends_it_in_one_line():
    async def interrupted(_):
        raise KeyboardInterrupt

    with pytest.raises(Interrupted):
        act(interrupted)

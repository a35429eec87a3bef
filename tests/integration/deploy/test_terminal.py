"""A run in a terminal: the panel, the keys, and the terminal as it was afterwards."""

import json
import re

from tests.support.deploy.pseudo_terminal import terminal
from tests.support.deploy.runs import LOSSY, swarmwire

LONG = ["--set", "duration_s=3600"]
FAULTY = """
from swarmwire.agent import Agent, Robot

class Faulty(Agent):
    def step(self, robot: Robot) -> None:
        if robot.time_s > 0.35:
            raise ZeroDivisionError("too much")
"""


def tick(picture: str) -> int:
    found = re.search(r"tick +(\d+)/36000", picture)
    return int(found[1]) if found else -1


def test_keys_pause_step_and_end_a_run(tmp_path):
    with terminal("run", LOSSY, *LONG, "--out", tmp_path / "run") as user:
        user.wait(lambda picture: "running" in picture and tick(picture) > 0)
        assert user.changed()
        user.type(" ")
        stands = tick(user.wait(lambda picture: "paused" in picture))
        for _ in range(3):
            assert tick(user.wait(lambda _: True)) == stands
        user.type("s")
        assert tick(user.wait(lambda picture: tick(picture) > stands)) == stands + 1
        user.type("x\x1b[A?")  # neither x nor an arrow means anything
        assert tick(user.wait(lambda picture: "one tick, then pause again" in picture)) == stands + 1
        user.type(" ")
        user.wait(lambda picture: tick(picture) > stands + 1)
        user.type("-")
        user.wait(lambda picture: "at most" in picture)
        user.type("q")
        text = user.rest()
        assert user.process.returncode == 130
        assert not user.changed()
        assert user.output.rfind(b"\x1b[?25h") > user.output.rfind(b"\x1b[?25l")  # the cursor is there again
    after = text[text.rindex("─╯") :]
    assert "interrupted" in after
    assert "swarmwire view" in after
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["ended"] == "interrupted"
    assert summary["ticks"] > stands + 1


def test_ctrl_c_ends_a_run_in_real_time_over_runners_and_gives_the_terminal_back(tmp_path):
    arguments = ["--runners", "2", "--realtime", "10", "--out", tmp_path / "run"]
    with terminal("run", LOSSY, *LONG, *arguments, columns=120, rows=40) as user:
        user.wait(lambda picture: "2 ready · 0 lost" in picture and tick(picture) > 0)
        user.type("+")
        user.wait(lambda picture: "real time x 20" in picture)
        user.type("\x03")
        user.rest()
        assert user.process.returncode == 130
        assert not user.changed()
    realtime = json.loads((tmp_path / "run" / "summary.json").read_text())["realtime"]
    assert realtime["factor"] == 20.0


def test_a_run_that_fails_gives_the_terminal_back(tmp_path):
    (tmp_path / "faulty.py").write_text(FAULTY)
    agent = ["--set", f"robots.flock.agent={tmp_path / 'faulty.py'}:Faulty", "--set", "robots.flock.params={}"]
    with terminal("run", LOSSY, *agent, "--out", tmp_path / "run") as user:
        text = user.rest()
        assert user.process.returncode == 1
        assert not user.changed()
    assert "too much" in text[text.rindex("─╯") :]


def test_without_a_terminal_there_are_plain_lines(tmp_path):
    ended = swarmwire("run", LOSSY, "--set", "duration_s=2", "--out", tmp_path / "run")
    assert "\x1b" not in ended.stdout
    lines = [line for line in ended.stdout.splitlines() if line.startswith("tick ")]
    assert [line.split(",")[0] for line in lines] == ["tick 5/20", "tick 10/20", "tick 15/20", "tick 20/20"]
    for line in lines:
        assert re.search(r", order [\d.]+, largest_component [\d.]+, components \d+, link PDR so far [\d.]+$", line)


def test_who_wants_quiet_gets_no_panel(tmp_path):
    with terminal("run", LOSSY, "--set", "duration_s=1", "--quiet", "--out", tmp_path / "run") as user:
        assert user.rest() == ""
        assert user.process.returncode == 0


def test_closing_the_terminal_ends_a_run_with_its_summary(tmp_path):
    with terminal("run", LOSSY, *LONG, "--runners", "2", "--out", tmp_path / "run") as user:
        user.wait(lambda picture: tick(picture) > 0)
        user.close()
        assert user.process.wait(20.0) == 129
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["ended"] == "interrupted"

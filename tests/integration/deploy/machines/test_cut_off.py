"""A cable that is pulled, with no word to either end: both notice, and the runner comes back once it is in again."""

import pytest

from tests.support.deploy.commands import LOSSY
from tests.support.deploy.machines.namespaces import machines
from tests.support.deploy.machines.on_machines import on

SETTINGS = ("duration_s=5000", "run.on_runner_loss=stand", "run.runner_timeout_s=3")


@pytest.mark.slow  # the runner waits for ten seconds before it believes it
def test_who_is_cut_off_is_told_at_both_ends_and_may_come_back(tmp_path):
    settings = [word for setting in SETTINGS for word in ("--set", setting)]
    with machines(2) as (lab, laptop):
        at = f"tcp/{lab.addresses[0]}:7447"
        join = "join", at, "--insecure", "--name", "a"
        world = ("world", LOSSY, *settings, "--listen", at, "--insecure", "--out", tmp_path / "run")
        with on(lab, *world) as world:
            world.said("0 of 20 robots have agents")
            with on(laptop, *join) as cut:
                world.said("20 robots, 50000 ticks")
                cut.said("joined run")
                laptop.link("down")
                world.said("a was lost with flock-0", "no answer for 3 s")
                assert cut.ended() == 1
                assert cut.lines[-1] == "the world is gone, or out of reach"
            laptop.link("up")
            with on(laptop, *join) as back:
                world.said("a returned to flock-0")
                assert world.stop() == 130
                assert back.ended() == 0

"""Runners that fail or are lost: what ends the run, and how it goes on without them."""

from typing import Any

import pytest

from swarmwire.comms.errors import AgentFailed, RunnerLost
from swarmwire.comms.packets import ReceivedPackets
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.tick_frames import encode_actions
from swarmwire.world.backends.join_policy import JoinRefused
from swarmwire.world.backends.lockstep import Lockstep
from tests.support.agent.hosts import MEASURES, plain
from tests.support.world.locksteps import actions, all_readings, joined, ready, request, state, two, two_parts


@pytest.mark.parametrize("opened", [False, True])
def test_a_failed_agent_ends_the_run_with_its_robots_and_traceback(opened: bool) -> None:
    lockstep = joined(two(), "a", "b")
    if opened:
        ready(lockstep, "a", "b").open_tick(0, all_readings(), ReceivedPackets.none(MEASURES))
    with pytest.raises(AgentFailed) as caught:
        lockstep.answer("b", frames.encode("failed", 0, {}, {"robots": "flock-4", "traceback": "Boom"}))
    assert (caught.value.robots, caught.value.traceback) == ("flock-4", "Boom")


@pytest.mark.parametrize("values", [{}, {"robots": "x"}, {"robots": 1, "traceback": "y"}], ids=repr)
def test_a_failure_without_words_names_the_runners_robots(values: dict[str, Any]) -> None:
    lockstep = joined(two(), "a", "b")
    with pytest.raises(AgentFailed) as caught:
        lockstep.answer("b", frames.encode("failed", 0, {}, values))
    assert caught.value.robots == "flock-4 … lone-7 (4 robots)"


def test_a_lost_runner_ends_the_run_if_it_plays_robots() -> None:
    lockstep = joined(two(), "a", "b")
    before = state(lockstep)
    lockstep.gone("stranger", "its link is gone")
    assert state(lockstep) == before
    with pytest.raises(RunnerLost) as caught:
        lockstep.gone("b", "its link is gone")
    assert (caught.value.runner, caught.value.robots) == ("b", "flock-4 … lone-7 (4 robots)")
    assert caught.value.reason == "its link is gone"


def test_robots_of_a_dead_runner_stand_still_and_nobody_waits_for_them() -> None:
    lockstep = ready(joined(Lockstep(two_parts(), "dead"), "a", "b"), "a", "b")
    lockstep.open_tick(0, all_readings(), ReceivedPackets.none(MEASURES))
    lockstep.gone("b", "its link is gone")
    assert (lockstep.waiting, lockstep.missing[0]) == (1, "a")
    for tick in range(2):
        lockstep.answer("a", encode_actions(tick, actions([0, 1, 2, 3])))
        assert not lockstep.waiting
        got = lockstep.take()
        still = got.rows > 3
        assert sorted(got.rows.tolist()) == list(range(8))
        assert got.drive[still].all()
        assert not got.linear_mps[still].any()
        assert not got.angular_radps[still].any()
        out = lockstep.open_tick(tick + 1, all_readings(tick + 1), ReceivedPackets.none(MEASURES))
        assert [name for name, _ in out] == ["a"]
    assert [loss.runner for loss in lockstep.losses] == ["b"]
    assert lockstep.counts() == {"runners_lost": 1}
    with pytest.raises(JoinRefused, match="all robots are taken"):
        lockstep.join("c", request())


@pytest.mark.parametrize("answered", [False, True])
def test_whoever_takes_over_gets_the_open_tick_even_if_the_lost_one_answered_it(answered: bool) -> None:
    lockstep = ready(joined(Lockstep(two_parts(), "wait"), "a", "b"), "a", "b")
    out = dict(lockstep.open_tick(0, all_readings(), ReceivedPackets.none(MEASURES)))
    lockstep.answer("a", encode_actions(0, actions([0, 1, 2, 3])))
    if answered:
        lockstep.answer("b", encode_actions(0, actions([4, 5, 6, 7])))
    lockstep.gone("b", "its link is gone")
    lockstep.lose_silent("no answer")  # nobody is there to be silent
    assert (lockstep.waiting, lockstep.missing[0], len(lockstep.losses)) == (1, "that did not join", 1)
    joined(lockstep, "c")
    again = lockstep.answer("c", frames.encode("ready", -1, {}))
    assert again == [("c", out["b"])]
    assert lockstep.waiting
    lockstep.answer("c", encode_actions(0, actions([4, 5, 6, 7])))
    assert not lockstep.waiting
    assert plain(lockstep.take()) == plain(actions(list(range(8))))
    assert [name for name, _ in lockstep.open_tick(1, all_readings(1), ReceivedPackets.none(MEASURES))] == ["a", "c"]


@pytest.mark.parametrize("on_loss", ["dead", "wait"])
def test_before_the_first_tick_every_loss_ends_the_run(on_loss: Any) -> None:
    lockstep = joined(Lockstep(two_parts(), on_loss), "a")
    with pytest.raises(RunnerLost):
        lockstep.gone("a", "its link is gone")
    with pytest.raises(RunnerLost, match="no answer"):
        lockstep.lose_silent("no answer")

"""Agents that join, leave and are lost, in lockstep over encoded frames: what robots do, and what is counted."""

import shutil

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy import Result, backends, run
from swarmwire.deploy.config import Listening
from swarmwire.deploy.simulation import Simulation
from tests.support.deploy.joiners import HERE, WANDERER, EncodedJoiners, Watcher, moves
from tests.support.deploy.runs import LOSSY


@pytest.fixture
def played(monkeypatch, tmp_path):
    """A short run of wanderers as a script says, and what was told; without one, with all agents in one host."""
    agent = shutil.copy(WANDERER, tmp_path)
    backend: list[EncodedJoiners] = []

    def play(on_loss: str = "stop", script: dict[int, list[str]] | None = None) -> tuple[Result, Watcher, list[str]]:
        watcher = Watcher()
        overrides = [f"robots.flock.agent={agent}:Wanderer", "robots.flock.params={}", "duration_s=1.5"]
        with monkeypatch.context() as patched:
            if script is not None:

                def made(assignment):
                    backend.append(EncodedJoiners(assignment, on_loss, script))
                    return backend[-1]

                patched.setattr(backends, "LocalBackend", made)
            result = run(LOSSY, overrides=overrides, observers=[watcher])
        told = [f"{change.what} {change.runner} {change.tick}" for of in backend for change in of.roster.events]
        return result, watcher, told

    return play


ALL = list(range(20))
BOTH = ["join a 8", "join b 12"]
SAME = {
    "they take all": ({-1: ["join a flock-3,flock-17", "join b 6", "join c"]}, "joined a -1, joined b -1, joined c -1"),
    "lost after it answered, and back": ({-1: BOTH, 7: ["lose a", "join a"]}, "lost a 7, returned a 7"),
    "lost before it answered, and back": ({-1: BOTH, 7: ["mute a", "lose a", "join a"]}, "lost a 7, returned a 7"),
    "lost, and others come": (
        {-1: BOTH, 7: ["mute b", "lose b", "join c flock-9", "join d"]},
        "lost b 7, joined c 7, joined d 7",
    ),
    "left, and another comes": ({-1: BOTH, 7: ["leave b", "join c"]}, "left b 7, joined c 7"),
    "lost twice": (
        {-1: BOTH, 3: ["lose a", "join a"], 9: ["lose a", "join a"]},
        "returned a 3, lost a 9, returned a 9",
    ),
}


@pytest.mark.parametrize(("script", "told"), SAME.values(), ids=SAME)
def test_where_the_run_waits_it_is_the_same_bit_for_bit(played, script, told):
    """Agents' State comes back with their robots."""
    result, _, changes = played("wait", script)
    assert ", ".join(changes).endswith(told)
    assert result.trajectory_sha256 == played()[0].trajectory_sha256
    assert not any(name.endswith("_frames") for name in result.counts)


LATE = {-1: ["join a 5"], 4: ["join b 4"], 9: ["leave b"]}
LOST = {-1: ["join a 5", "join b"], 6: ["mute a", "lose a"], 11: ["join a"]}
WITHOUT = {
    "a late joiner, which leaves": (
        LATE,
        {"stand": {0: ALL[:5], 5: ALL[:9], 9: ALL[:5]}, "coast": {0: ALL[:5], 5: ALL[:9]}},
        {"runners_joined_late": 1, "runners_left": 1},
    ),
    "one that is lost, and back": (
        LOST,
        {"stand": {0: ALL, 6: ALL[5:], 12: ALL}, "coast": {0: ALL}},
        {"runners_lost": 1, "runners_returned": 1},
    ),
    "nobody": ({-1: []}, {"stand": {0: []}, "coast": {0: []}}, {}),
}


@pytest.mark.parametrize("on_loss", ["stand", "coast"])
@pytest.mark.parametrize(("script", "expected", "counts"), WITHOUT.values(), ids=WITHOUT)
def test_where_the_run_goes_on_robots_without_an_agent_stand_or_coast(played, on_loss, script, expected, counts):
    result, watcher, _ = played(on_loss, script)
    assert result.ticks == 15
    assert moves(watcher.truths) == expected[on_loss]
    told = {name: count for name, count in result.counts.items() if name.startswith("runners_")}
    assert told == counts
    assert ("packets_without_agent" in result.counts) == bool(counts)


def test_robots_that_coast_do_what_they_did_last_to_the_last_digit(played):
    _, watcher, _ = played("coast", LOST)
    commands = [truth.command[:5].tolist() for truth in watcher.truths]
    assert all(command == commands[5] for command in commands[5:12])
    assert len({str(command) for command in commands[:6] + commands[12:]}) == 9


def test_robots_of_a_runner_that_is_dead_stand_to_the_end(played):
    result, watcher, _ = played("dead", {-1: BOTH, 6: ["lose a"]})
    assert moves(watcher.truths) == {0: ALL, 6: ALL[8:]}
    assert result.counts["runners_lost"] == 1


def test_who_leaves_a_run_that_cannot_do_without_ends_it(played):
    result, *_ = played("stop", {-1: BOTH, 6: ["leave a"]})
    assert (result.ended, result.ticks) == ("left", 6)


@pytest.mark.parametrize(
    ("listening", "overrides", "key"),
    [
        (Listening(("tcp/0.0.0.0:0",)), [], "--listen"),
        (Listening(("nonsense",)), [], "--listen"),
        (Listening(HERE, observed=("tcp/10.0.0.5:1",)), [], "--observe"),
        (Listening(HERE, observed=HERE), [], "--observe"),
        (Listening(HERE, start_with=21), [], "--start-with"),
        (Listening(HERE, start_with=5), [], "run.on_runner_loss"),
        (Listening(HERE, start_with=5), ["run.on_runner_loss=wait"], "run.on_runner_loss"),
    ],
)
def test_what_cannot_be_listened_for_is_bad_input(listening, overrides, key):
    with pytest.raises(BadInput) as refused:
        Simulation(LOSSY, overrides=overrides, listening=listening)
    assert key in (refused.value.where, refused.value.key)

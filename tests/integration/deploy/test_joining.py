"""Agents from elsewhere join, leave, are killed, frozen, thawed, in lockstep: what robots do, and what is counted."""

import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.comms.truth import Truth
from swarmwire.comms.wire.frames import VERSION
from swarmwire.deploy import repeat, run
from swarmwire.deploy.listening import Listening
from swarmwire.deploy.simulation import Simulation
from swarmwire.world.crews.change import Change
from tests.integration.deploy.test_realtime import Watcher
from tests.support.deploy.commands import LOSSY
from tests.support.deploy.joiners import HERE, Joiners

LONG = "duration_s=5000"
SHORT = "duration_s=3"


@pytest.fixture
def joiners(tmp_path) -> Iterator[Joiners]:
    found = Joiners(tmp_path)
    yield found
    found.close()


def interrupt() -> None:
    signal.raise_signal(signal.SIGINT)


def moving(truth: Truth) -> list[int]:
    """Robots that are told to move."""
    return [row for row, command in enumerate(truth.command) if command.any()]


def alone(joiners: Joiners, *overrides: str) -> list[str]:
    """The hashes of the same run with all agents in one process."""
    return run(LOSSY, overrides=[*joiners.overrides, *overrides]).trajectory_sha256


def test_a_run_with_agents_from_elsewhere_is_the_same_bit_for_bit(joiners):
    joiners.first = [("a", "--names", "flock-3,flock-17"), ("b", "--robots", "6"), ("c", "--robots", "12")]
    result = joiners.run(SHORT)
    assert result.trajectory_sha256 == alone(joiners, SHORT)
    assert (result.mode, result.runners, result.ended) == ("lockstep", 3, "duration")
    assert joiners.told == [("joined", name) for name in "abc"]
    assert all(change.tick == -1 for change in result.runner_changes)
    assert result.inputs is None  # all follows from scenario and seed
    for name in "abc":
        code, said = joiners.said(name)
        assert code == 0
        assert said.splitlines()[0].startswith(f"{name}: joined run ")
        assert said.splitlines()[-1] == "the run is over"


def test_a_runner_that_is_killed_and_returns_goes_on_where_it_was(joiners, tmp_path):
    """With `wait` the run is that in which nothing happened: its agents' State came back with their robots."""
    joiners.first = [("a", "--robots", "8"), ("b", "--robots", "12")]

    def again(change: Change) -> None:
        if change.what == "lost":
            joiners.said("a")
            joiners.start("a", "--names", ",".join(change.robots))

    joiners.on_change = again
    watcher = Watcher((lambda truth: truth.tick == 11, lambda: joiners.send("a", signal.SIGKILL)))
    result = joiners.run(SHORT, "run.on_runner_loss=wait", watcher=watcher, out=tmp_path / "run")
    assert joiners.told[2:] == [("lost", "a"), ("returned", "a")]
    assert [change.tick for change in result.runner_changes[2:]] == [12, 12]
    assert result.runner_changes[2].reason == "its process or its link is gone"
    assert result.counts["runners_lost"] == result.counts["runners_returned"] == 1
    assert result.trajectory_sha256 == alone(joiners, SHORT)
    assert repeat(tmp_path / "run").same


@pytest.mark.parametrize("on_loss", ["stand", "coast"])
def test_a_late_joiner_s_robots_wait_for_it_and_who_leaves_is_no_crash(joiners, tmp_path, on_loss):
    joiners.first = [("a", "--robots", "5")]
    seen: dict[str, int] = {}

    def late(change: Change) -> None:
        seen[f"{change.what} {change.runner}"] = change.tick

    joiners.on_change = late
    watcher = Watcher(
        (lambda truth: truth.tick >= 5, lambda: joiners.start("b", "--robots", "4")),
        (
            lambda truth: "joined b" in seen and truth.tick > seen["joined b"] + 3,
            lambda: joiners.send("b", signal.SIGINT),
        ),
        (lambda truth: "left b" in seen and truth.tick > seen["left b"] + 3, interrupt),
    )
    result = joiners.run(LONG, f"run.on_runner_loss={on_loss}", watcher=watcher, start_with=5, out=tmp_path / "run")
    joined, left = seen["joined b"], seen["left b"]
    of_b = list(range(5, 9))
    for truth in watcher.truths:
        acts = truth.tick > joined and (truth.tick < left or on_loss == "coast")
        if truth.tick != left or on_loss == "coast":
            assert moving(truth) == [*range(5), *(of_b if acts else [])], truth.tick
    if on_loss == "coast":  # they do what they did last, to the last digit
        last = watcher.truths[-1].command[5:9]
        assert (watcher.truths[-3].command[5:9] == last).all()
    assert joiners.told == [("joined", "a"), ("joined", "b"), ("left", "b")]
    assert result.counts["runners_joined_late"] == result.counts["runners_left"] == 1
    assert "runners_lost" not in result.counts
    assert not result.lost_runners
    assert result.counts["packets_without_agent"] > 0
    assert result.inputs is not None
    assert result.inputs.first_tick == 0
    code, said = joiners.said("b")
    assert (code, said.splitlines()[-1]) == (130, "left the run")
    repetition = repeat(tmp_path / "run")
    assert repetition.same
    assert repetition.result.ticks == result.ticks


def test_a_frozen_runner_is_lost_after_its_time_out_and_told_to_leave_when_it_thaws(joiners, tmp_path):
    joiners.first = [("a", "--robots", "5"), ("b", "--robots", "15")]
    lost: list[int] = []
    joiners.on_change = lambda change: lost.append(change.tick) if change.what == "lost" else None
    watcher = Watcher(
        (lambda truth: truth.tick == 8, lambda: joiners.send("a", signal.SIGSTOP)),
        (lambda truth: bool(lost) and truth.tick > lost[0] + 5, lambda: joiners.send("a", signal.SIGCONT)),
        (lambda truth: truth.tick > lost[0] + 10, interrupt),
    )
    result = joiners.run(
        LONG,
        "run.on_runner_loss=stand",
        "run.runner_timeout_s=1",
        watcher=watcher,
        out=tmp_path / "run",
    )
    assert [str(change) for change in joiners.changes[2:]] == [
        "a was lost with flock-0 … flock-4 (5 robots) in tick 9: no answer for 1 s"
    ]
    assert result.counts["runners_lost"] == 1
    assert [len(moving(truth)) for truth in watcher.truths[7:]] == [20, 20, *[15] * (result.ticks - 9)]
    code, said = joiners.said("a")
    assert (code, said.splitlines()[-1]) == (1, "the world let it go: no answer for 1 s")
    assert repeat(tmp_path / "run").same


def test_a_runner_that_leaves_a_run_that_cannot_do_without_ends_it_in_order(joiners):
    joiners.first = [("a",)]
    watcher = Watcher((lambda truth: truth.tick == 4, lambda: joiners.send("a", signal.SIGINT)))
    result = joiners.run(LONG, watcher=watcher)
    assert (result.ended, result.error) == ("left", None)
    assert joiners.said("a")[0] == 130


def test_a_runner_in_the_background_of_a_script_leaves_in_order_too(joiners):
    """There a shell has Ctrl-C ignored, so a signal to end finds nothing that Ctrl-C did before."""
    joiners.before = ("sh", "-c", "trap '' INT; exec \"$@\"", "sh")
    joiners.first = [("a",)]
    watcher = Watcher((lambda truth: truth.tick == 4, lambda: joiners.send("a", signal.SIGTERM)))
    result = joiners.run(LONG, watcher=watcher)
    assert (result.ended, result.error) == ("left", None)
    code, said = joiners.said("a")
    assert (code, said.splitlines()[-1]) == (130, "left the run")


def test_who_may_not_join_is_told_why_at_both_ends_and_the_run_goes_on(joiners, tmp_path):
    other = tmp_path / "other.py"
    other.write_text(joiners.agent.read_text() + "\n")
    joiners.first = [("a", "--names", "flock-0")]
    refused = {
        "b": (("--names", "flock-0"), "taken, by a: flock-0"),
        "c": (
            ("--names", "flok-1"),
            "expected names of robots, each once (flock-0 … flock-19 (20 robots)), got flok-1",
        ),
        "d": (("--robots", "20"), "expected at most 19 robots, which are free, got 20"),
        "e": (
            ("--scenario", other),
            "another scenario: here is 'flocking over a lossy radio', whose file has another sha256",
        ),
        "f": (("--agent", f"{other}:Wanderer"), "another agent for flock"),
    }
    joiners.on_change = lambda _: [joiners.start(name, *asked) for name, (asked, _) in refused.items()]
    ends: dict[str, tuple[int, str]] = {}

    def after(runner: str, why: str) -> None:
        joiners.refusals.append((runner, why))
        if len(joiners.refusals) == len(refused):
            joiners.on_change = lambda _: None
            joiners.start("z", "--robots", "19")

    joiners.refused = after
    result = joiners.run(SHORT)
    for name, (_, why) in refused.items():
        ends[name] = joiners.said(name)
        assert ends[name][0] == 1
        assert ends[name][1].splitlines()[-1].startswith(f"runner {name} got no robots: {why}")
        assert any(runner == name and text.startswith(why) for runner, text in joiners.refusals)
    assert result.counts["refused_join"] == len(refused)
    assert result.trajectory_sha256 == alone(joiners, SHORT)


def test_another_version_is_told_at_both_ends(joiners):
    ends: list[str] = []

    def strange(_: Change) -> None:
        if not ends:
            ends.append("")
            later = "from swarmwire.comms.wire import frames; frames.VERSION += 1; "
            program = later + "from swarmwire.agent.cli import main; raise SystemExit(main())"
            command = [sys.executable, "-c", program, "join", joiners.endpoint, "--name", "b"]
            joiners.processes["b"] = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)

    joiners.first = [("a", "--robots", "5")]
    joiners.on_change = strange
    joiners.refused = lambda runner, why: (joiners.refusals.append((runner, why)), joiners.start("c"))
    result = joiners.run(SHORT)
    why = f"version: expected version {VERSION} of the frames, got {VERSION + 1}"
    assert joiners.refusals == [("b", why)]
    assert joiners.said("b") == (1, f"runner b got no robots: {why}\n")
    assert result.counts["bad_join"] == 1


def test_a_name_in_use_is_refused(joiners):
    joiners.first = [("a", "--robots", "1")]
    once: list[str] = []

    def second(change: Change) -> None:
        if not once:
            once.append(change.runner)
            first = joiners.processes.pop("a")
            joiners.start("a", "--robots", "1")
            joiners.processes["first a"] = first

    joiners.on_change = second
    joiners.refused = lambda runner, why: (joiners.refusals.append((runner, why)), joiners.start("b"))
    joiners.run(SHORT)
    assert joiners.refusals == [("a", "the name a is in use: another runner of this name plays")]
    assert joiners.said("a")[1].splitlines()[-1] == f"runner a got no robots: {joiners.refusals[0][1]}"


@pytest.mark.parametrize(
    ("listening", "overrides", "why"),
    [
        (Listening(("tcp/0.0.0.0:0",)), [], "reaches beyond this machine"),
        (Listening(("nonsense",)), [], "expected endpoints such as"),
        (Listening(HERE, observed=("tcp/10.0.0.5:1",)), [], "--observe"),
        (Listening(HERE, observed=HERE), [], "--observe: expected a run folder with it"),
        (Listening(HERE, start_with=21), [], "expected 0 to 20"),
        (Listening(HERE, start_with=5), [], "expected stand or coast with --start-with"),
        (Listening(HERE, start_with=5), ["run.on_runner_loss=wait"], "expected stand or coast with --start-with"),
    ],
)
def test_what_cannot_be_listened_for_is_bad_input(listening, overrides, why):
    with pytest.raises(BadInput, match=why):
        Simulation(LOSSY, overrides=overrides, listening=listening)

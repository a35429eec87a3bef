"""Runners that are processes join, leave, are killed, frozen and thawed, in lockstep and real time.

`tests/unit/deploy/test_agents_at_large.py` has more cases over the same frames in one process.
"""

import signal
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import pytest

from swarmwire.comms.observe.truth import Truth
from swarmwire.deploy import repeat, run
from tests.support.deploy.joiners import Joiners, Watcher, interrupt, moving
from tests.support.deploy.runs import LOSSY

When = Callable[[Joiners, Truth], bool]
LEFT, OVER = (130, "left the run"), (0, "the run is over")
LONG, SHORT = "duration_s=5000", "duration_s=3"
FACTOR = 5.0


def at(tick: int) -> When:
    return lambda _, truth: truth.tick >= tick


def move(robots: int) -> When:
    return lambda _, truth: len(moving(truth)) == robots


def after(change: str, ticks: int) -> When:
    """Some ticks after this was told."""
    return lambda joiners, truth: (tick := joiners.tick_of(change)) is not None and truth.tick > tick + ticks


def ended(name: str) -> When:
    return lambda joiners, _: joiners.processes[name].poll() is not None


@dataclass(frozen=True)
class Case:
    """Who joins before the first tick, what happens then, and what comes of it.

    `steps` are made one after the other, each once its condition holds; `upon` is made when a change is told. "start a
    --robots 4" starts a runner, "SIGKILL a" sends a signal, "quit" is Ctrl-C in the world.
    """

    on_loss: str
    first: tuple[str, ...]
    changes: str  # after those who joined before the first tick
    steps: tuple[tuple[When, str], ...] = ()
    upon: Mapping[str, str] = field(default_factory=dict)
    settings: tuple[str, ...] = (LONG,)
    start_with: int | None = None
    realtime: float | None = None
    subtick: float | None = None
    before: tuple[str, ...] = ()  # what starts the runners
    over: str = "interrupted"
    counts: Mapping[str, int] = field(default_factory=dict)
    reason: str = ""  # of the first change of `changes`
    ends: Mapping[str, tuple[int, str]] = field(default_factory=dict)  # exit code and last line, by runner
    stopped: range = range(0)  # robots that the watchdog stopped, at least
    same: bool = False  # as with all agents in one process
    repeats: bool = True


FROZEN = ((at(8), "SIGSTOP a"), (after("lost a", 5), "SIGCONT a"), (after("lost a", 10), "quit"))
NO_ANSWER = "no answer for 1 s"
CASES = {
    "killed, and back": Case(
        on_loss="wait",
        first=("a --robots 8", "b --robots 12"),
        steps=((at(11), "SIGKILL a"),),
        upon={"lost a": "start a"},
        changes="lost a, returned a",
        settings=(SHORT,),
        over="duration",
        counts={"runners_lost": 1, "runners_returned": 1},
        reason="its process or its link is gone",
        ends={"a": OVER, "b": OVER},
        same=True,
    ),
    "late, and leaves": Case(
        on_loss="stand",
        first=("a --robots 5",),
        start_with=5,
        steps=((at(5), "start b --robots 4"), (move(9), "SIGINT b"), (move(5), "quit")),
        changes="joined b, left b",
        counts={"runners_joined_late": 1, "runners_left": 1},
        ends={"b": LEFT},
    ),
    "frozen for too long": Case(
        on_loss="stand",
        first=("a --robots 5", "b --robots 15"),
        settings=(LONG, "run.runner_timeout_s=1"),
        steps=FROZEN,
        changes="lost a",
        counts={"runners_lost": 1},
        reason=NO_ANSWER,
        ends={"a": (1, f"the world removed the runner: {NO_ANSWER}")},
    ),
    "in the background of a script, where Ctrl-C is ignored": Case(
        on_loss="stop",
        before=("sh", "-c", "trap '' INT; exec \"$@\"", "sh"),
        first=("a",),
        steps=((at(4), "SIGTERM a"),),
        changes="",
        over="left",
        ends={"a": LEFT},
        repeats=False,
    ),
    "real time with subticks: late, and leaves": Case(
        on_loss="stand",
        realtime=FACTOR,
        subtick=0.005,
        first=("a --robots 5",),
        start_with=5,
        steps=((move(5), "start b --robots 4"), (move(9), "SIGINT b"), (move(5), "quit")),
        changes="joined b, left b",
        settings=(LONG, "run.watchdog_s=1000"),
        counts={"runners_joined_late": 1, "runners_left": 1},
        ends={"b": LEFT},
    ),
    "real time: frozen, stopped by the watchdog, lost": Case(
        on_loss="wait",
        realtime=FACTOR,
        first=("a --robots 5", "b --robots 15"),
        steps=((move(20), "SIGSTOP a"), (move(15), ""), (after("lost a", 5), "SIGCONT a"), (ended("a"), "quit")),
        changes="lost a",
        settings=(LONG, "run.watchdog_s=0.5", "run.runner_timeout_s=1"),
        counts={"runners_lost": 1},
        reason=NO_ANSWER,
        ends={"a": (1, f"the world removed the runner: {NO_ANSWER}")},
        stopped=range(5),
    ),
}


@pytest.fixture
def joiners(tmp_path) -> Iterator[Joiners]:
    runners = Joiners(tmp_path)
    yield runners
    runners.close()


def do(joiners: Joiners, line: str) -> None:
    """One line of a case."""
    action, *words = line.split() or [""]
    if action == "start":
        if words[0] in joiners.processes:  # which was killed
            joiners.outcome(words[0])
        joiners.start(words[0], *words[1:])
    elif action == "quit":
        interrupt()
    elif action:
        joiners.send(words[0], signal.Signals[action])


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_runners_that_join_leave_or_are_lost_change_a_run_as_stated(joiners, tmp_path, case):
    joiners.before = case.before
    joiners.first = [tuple(line.split()) for line in case.first]
    joiners.on_change = lambda change: do(joiners, case.upon.get(f"{change.what} {change.runner}", ""))
    steps = [
        (lambda truth, when=when: when(joiners, truth), lambda line=line: do(joiners, line))
        for when, line in case.steps
    ]
    watcher, settings = Watcher(*steps), (*case.settings, f"run.on_runner_loss={case.on_loss}")
    options = {"start_with": case.start_with, "realtime": case.realtime, "subtick": case.subtick}
    result = joiners.run(*settings, watcher=watcher, out=tmp_path / "run", **options)
    assert not watcher.steps
    first = [f"joined {line.split()[0]}" for line in case.first]
    changes = case.changes.split(", ") if case.changes else []
    assert [" ".join(change) for change in joiners.events] == [*first, *changes]
    assert all(change.tick == -1 for change in result.runner_events[: len(first)])
    assert not case.reason or result.runner_events[len(first)].reason == case.reason
    assert result.ended == case.over
    assert result.mode == ("realtime" if case.realtime else "lockstep")
    counts = {name: count for name, count in result.counts.items() if name.startswith("runners_")}
    assert counts == (case.counts or counts)
    assert (len(result.lost_runners) == 0) == ("lost" not in case.changes)
    for name, (code, last) in case.ends.items():
        exit_code, output = joiners.outcome(name)
        assert (exit_code, output.splitlines()[-1]) == (code, last)
        assert output.splitlines()[0].startswith(f"{name}: joined run ")
    stops = result.realtime.watchdog_stops.keys() if result.realtime else set[str]()
    assert {f"flock-{row}" for row in case.stopped} <= stops
    if case.same:
        assert result.trajectory_sha256 == alone(joiners, *settings)
    assert (result.inputs is None) == (not case.changes)  # all follows from scenario and seed
    if case.repeats:
        repetition = repeat(tmp_path / "run")
        assert repetition.same
        assert repetition.result.ticks == result.ticks


def alone(joiners: Joiners, *overrides: str) -> list[str]:
    """The hashes of the same run with all agents in one process."""
    return run(LOSSY, overrides=[*joiners.overrides, *overrides]).trajectory_sha256


def test_runner_that_may_not_join_is_told_why_at_both_ends(joiners, tmp_path):
    other = tmp_path / "other.py"
    other.write_text(joiners.agent.read_text() + "\n")
    joiners.first = [("a", "--names", "flock-0")]
    refused = {
        "a": (("--robots", "1"), "the name a is in use"),  # killed and back before the world noticed, or another's
        "b": (("--names", "flock-0"), "taken, by a: flock-0"),
        "c": (("--scenario", other), "another scenario: here is"),
        "d": (("--agent", f"{other}:Wanderer"), "another agent for flock"),
    }

    def others(_: object) -> None:
        joiners.on_change = lambda _: None
        for name, (options, _) in refused.items():
            joiners.start(name, *options, label=f"refused {name}")

    def after(runner: str, why: str) -> None:
        joiners.refusals.append((runner, why))
        if len(joiners.refusals) == len(refused):
            joiners.start("z", "--robots", "19")

    joiners.on_change, joiners.refused = others, after
    result = joiners.run(SHORT)
    for name, (_, why) in refused.items():
        code, output = joiners.outcome(f"refused {name}")
        assert code == 1
        assert output.splitlines()[-1].startswith(f"runner {name} got no robots: {why}")
        assert any(runner == name and text.startswith(why) for runner, text in joiners.refusals)
    assert result.counts["refused_join"] == len(refused)
    assert result.trajectory_sha256 == alone(joiners, SHORT)

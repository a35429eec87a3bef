"""Misbehaving runners, and runs that wait for runners."""

import re
import signal
import threading
from collections import Counter
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest

from examples.protocol.runner import frame
from swarmwire.comms.base.errors import AgentFailed, Interrupted
from swarmwire.deploy.live.remote_control import RemoteControl, controlling
from swarmwire.deploy.runs.config import Listening, Recording
from swarmwire.deploy.runs.live_address import Announcement, live_runs, read_live
from swarmwire.deploy.runs.result import Result
from swarmwire.deploy.runs.simulation import Simulation, run_to_end
from tests.support.clocks import until
from tests.support.deploy.joiners import LOCALHOST, Joiners
from tests.support.deploy.runs import LOSSY
from tests.support.runners import BESIDE, EARLY, INSTEAD, Played, Prank, Says, Turn

PAGE = Path(__file__).parents[3] / "docs" / "reliability.md"
ROW = re.compile(r"^\| (.+?) \| (.*?`.+?) \|", re.M)
FIRST, EVERY = 6, 2  # the tick of the first prank, and ticks from one to the next: what comes late counts in the second


def lasting(pranks: Sequence[Prank]) -> int:
    return FIRST + EVERY * len(pranks) + 2


TICKS = lasting(BESIDE)


@pytest.fixture(scope="module")
def honest() -> tuple[Result, Played]:
    """The run of two honest runners."""
    played = Played(ticks=TICKS)
    return played.run(), played


def in_turn(pranks: Sequence[Prank]) -> Says:
    """A prank every other tick; an honest answer in all other ticks."""

    def play(turn: Turn) -> Sequence[bytes]:
        number, phase = divmod(turn.tick - FIRST, EVERY)
        return pranks[number].says(turn) if phase == 0 and 0 <= number < len(pranks) else [turn.honest]

    return play


def frames(result: Result) -> dict[str, int]:
    """Counts of messages and runners."""
    return {name: count for name, count in result.counts.items() if count and not name.endswith("_commands")}


def test_pranks_beside_honest_answers_are_counted_and_change_nothing(honest: tuple[Result, Played]) -> None:
    played = Played(in_turn(BESIDE), TICKS)
    result = played.run()
    assert result.trajectory_sha256 == honest[0].trajectory_sha256
    for number, prank in enumerate(BESIDE):
        tick = FIRST + EVERY * number
        assert played.counted[tick + 1] - played.counted[tick - 1] == Counter(prank.counts), prank.title
    assert (result.ended, result.ticks) == ("duration", TICKS)
    assert any(refusal.startswith("the name odd is in use") for refusal in played.refusals)


def test_pranks_in_place_of_answers_harm_only_their_own_robots(honest: tuple[Result, Played]) -> None:
    played = Played(in_turn(INSTEAD), TICKS, EARLY.says(None))
    result = played.run()
    first, second = zip(result.trajectory_sha256, honest[0].trajectory_sha256, strict=True)
    assert first[0] == first[1]
    assert second[0] != second[1]
    assert frames(result) == {**EARLY.counts, "packets_to_nobody": 4}
    odd_arena = result.arenas[1]
    assert (odd_arena.counts["nan_commands"], odd_arena.counts["packets_to_nobody"]) == (3, 4)
    assert odd_arena.counts["clipped_commands"] >= 3
    assert odd_arena.radio.fates["too_large"] == 4
    assert odd_arena.radio.fates["queue_full"] > 500
    assert sum(odd_arena.radio.fates.values()) == odd_arena.radio.intended


def test_replayed_answers_drive_only_their_own_robots(honest: tuple[Result, Played]) -> None:
    """Their age does not show; a runner that has them could also make up others."""
    before = honest[1].runners["odd"].frames
    played = Played(lambda turn: [before[turn.tick]] if turn.tick != 4 else [before[2], turn.honest], TICKS)
    result = played.run()
    assert result.trajectory_sha256 == honest[0].trajectory_sha256
    assert frames(result) == {"wrong_tick_frames": 1}


def test_runner_that_sends_half_an_answer_is_lost(honest: tuple[Result, Played]) -> None:
    played = Played(lambda turn: [turn.honest[:50]] if turn.tick == 8 else [turn.honest], TICKS)
    result = played.run("run.on_runner_loss=dead", "run.runner_timeout_s=0.5")
    assert result.trajectory_sha256[0] == honest[0].trajectory_sha256[0]
    assert result.trajectory_sha256[1] != honest[0].trajectory_sha256[1]
    assert frames(result) == {"malformed_frames": 1, "runners_lost": 1}
    assert result.ticks == TICKS


def test_pranks_in_real_time_are_counted_and_delay_nothing() -> None:
    """The world does not wait: on a busy machine the runner gets fewer turns."""
    pranks = list(BESIDE)
    result = Played(lambda turn: pranks.pop(0).says(turn) if pranks else [turn.honest], 10 * TICKS).run(realtime=50.0)
    expected = sum((Counter(prank.counts) for prank in BESIDE[: len(BESIDE) - len(pranks)]), Counter[str]())
    counted = Counter({name: result.counts.get(name, 0) for name in expected})
    assert (result.ended, result.ticks) == ("duration", 10 * TICKS)
    assert counted["wrong_tick_frames"] > 0
    # If the world was ahead, the answer to the next tick fitted, and the honest answer was late.
    del counted["wrong_tick_frames"]
    assert not counted - expected


def test_reported_agent_failure_ends_the_run_with_its_traceback() -> None:
    lies = frame("failed", -1, {}, {"robots": "all\x1b[31m", "traceback": "made up"})
    with pytest.raises(AgentFailed, match="made up"):
        Played(lambda _: [lies]).run()


def test_pranks_have_their_counts_listed_in_the_docs() -> None:
    listed = {count for _, counted in ROW.findall(section()) for count in re.findall(r"`(\w+)`", counted)}
    assert listed == {count for prank in (EARLY, *BESIDE, *INSTEAD) for count in (*prank.counts, *prank.fates)}


def section() -> str:
    return PAGE.read_text(encoding="utf-8").split("\n## Misbehaving runners\n")[1].split("\n## ")[0]


@pytest.fixture
def joiners(tmp_path) -> Iterator[Joiners]:
    started = Joiners(tmp_path)
    yield started
    started.close()


Listened = tuple[Simulation, RemoteControl, list[str]]


@contextmanager
def listening(folder: Path, joiners: Joiners, *overrides: str) -> Generator[Listened]:
    """A run in a thread that listens for runners, its control, and the error that ended it."""
    options = {"listening": Listening(LOCALHOST, observer=joiners), "record": Recording(rrd=False, tables=False)}
    simulation = Simulation(LOSSY, overrides=[*joiners.overrides, *overrides], out=folder, **options)
    simulation.watch(Announcement(folder))
    errors: list[str] = []

    def run() -> None:
        try:
            run_to_end(simulation)
        except Interrupted as error:
            errors.append(str(error))

    thread = threading.Thread(target=run)
    thread.start()
    try:
        live = until(lambda: read_live(folder))
        with controlling(live.endpoint, live.run) as control:
            yield simulation, control, errors
    finally:
        simulation.controls.quit()
        thread.join()


def waits(control: RemoteControl) -> str:
    """The runner that a waiting run waits for."""
    return until(control.status, lambda status: status["state"] == "waiting")["runners"]["waits_for"]


def test_run_that_waits_for_its_first_runner_can_be_controlled(tmp_path, joiners):
    with listening(tmp_path / "run", joiners) as (simulation, control, errors):
        until(lambda: simulation.run_id in [run.run for run in live_runs()])
        assert waits(control) == "the runner that plays flock-0 … flock-19 (20 robots)"
        control.step(2)
        control.event({"do": "kill", "robots": {"names": ["flock-3"]}})
        joiners.start("a")
        status = until(control.status, lambda status: (status["state"], status["tick"]) == ("paused", 2))
        assert status["alive"] == 19
    assert errors == []
    with listening(tmp_path / "other", joiners) as (simulation, control, errors):
        control.stop()
        until(lambda: errors)
    assert errors == ["interrupted while it waited for its runners"]
    assert read_live(tmp_path / "other") is None
    assert simulation.run_id not in [run.run for run in live_runs()]


def test_run_names_the_frozen_or_lost_runner_that_it_waits_for(tmp_path, joiners):
    joiners.first = [("a",)]
    with listening(tmp_path / "run", joiners, "run.on_runner_loss=wait", "duration_s=5000") as (_, control, _):
        until(control.status, lambda status: status["tick"] > 3)
        joiners.send("a", signal.SIGSTOP)
        assert waits(control) == "a, which plays flock-0 … flock-19 (20 robots)"
        joiners.send("a", signal.SIGCONT)
        until(control.status, lambda status: status["state"] == "running")
        joiners.send("a", signal.SIGKILL)
        until(control.status, lambda status: status["runners"]["lost"] == 1)
        assert waits(control) == "the runner that plays flock-0 … flock-19 (20 robots)"

"""What a runner does that it should not is counted by name, and changes nothing for others (docs/reliability.md)."""

import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import pytest

from examples.protocol.runner import frame
from swarmwire.comms.errors import AgentFailed
from swarmwire.deploy.result import Result
from tests.support.runners.played import Played
from tests.support.runners.pranks import BESIDE, EARLY, INSTEAD, Prank
from tests.support.runners.raw_runner import Says, Turn

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


def one_after_the_other(pranks: Sequence[Prank]) -> Says:
    """A prank every other tick; in all other ticks the runner is honest."""

    def says(turn: Turn) -> Sequence[bytes]:
        number, rest = divmod(turn.tick - FIRST, EVERY)
        return pranks[number].says(turn) if rest == 0 and 0 <= number < len(pranks) else [turn.honest]

    return says


def frames(result: Result) -> dict[str, int]:
    """What was counted of messages and runners."""
    return {name: count for name, count in result.counts.items() if count and not name.endswith("_commands")}


def test_what_is_said_beside_the_honest_answer_is_counted_and_changes_nothing(honest: tuple[Result, Played]) -> None:
    played = Played(one_after_the_other(BESIDE), TICKS)
    result = played.run()
    assert result.trajectory_sha256 == honest[0].trajectory_sha256
    for number, prank in enumerate(BESIDE):
        tick = FIRST + EVERY * number
        assert played.counted[tick + 1] - played.counted[tick - 1] == Counter(prank.counts), prank.what
    assert (result.ended, result.ticks) == ("duration", TICKS)
    assert "the name odd is in use: another runner of this name plays" in played.refusals


def test_what_is_said_instead_of_it_does_harm_to_its_own_robots_alone(honest: tuple[Result, Played]) -> None:
    played = Played(one_after_the_other(INSTEAD), TICKS, EARLY.says(None))
    result = played.run()
    first, second = zip(result.trajectory_sha256, honest[0].trajectory_sha256, strict=True)
    assert first[0] == first[1]
    assert second[0] != second[1]
    assert frames(result) == {**EARLY.counts, "packets_to_nobody": 4}
    own = result.arenas[1]
    assert (own.counts["nan_commands"], own.counts["packets_to_nobody"]) == (3, 4)
    assert own.counts["clipped_commands"] >= 3
    assert own.radio is not None
    assert own.radio.fates["too_large"] == 4
    assert own.radio.fates["queue_full"] > 500
    assert sum(own.radio.fates.values()) == own.radio.intended


def test_answers_of_an_earlier_run_are_those_of_its_own_robots(honest: tuple[Result, Played]) -> None:
    """Nothing in them tells that they are old; a runner that has them can as well make up others."""
    before = honest[1].runners["odd"].frames
    played = Played(lambda turn: [before[turn.tick]] if turn.tick != 4 else [before[2], turn.honest], TICKS)
    result = played.run()
    assert result.trajectory_sha256 == honest[0].trajectory_sha256
    assert frames(result) == {"wrong_tick_frames": 1}


def test_half_an_answer_and_no_more_is_a_lost_runner(honest: tuple[Result, Played]) -> None:
    played = Played(lambda turn: [turn.honest[:50]] if turn.tick == 8 else [turn.honest], TICKS)
    result = played.run("run.on_runner_loss=dead", "run.runner_timeout_s=0.5")
    assert result.trajectory_sha256[0] == honest[0].trajectory_sha256[0]
    assert result.trajectory_sha256[1] != honest[0].trajectory_sha256[1]
    assert frames(result) == {"malformed_frames": 1, "runners_lost": 1}
    assert result.ticks == TICKS


def test_in_real_time_the_same_is_counted_and_the_world_keeps_its_pace() -> None:
    """However many of its turns the runner comes to: on a busy machine the world does not wait for it."""
    left = list(BESIDE)
    result = Played(lambda turn: left.pop(0).says(turn) if left else [turn.honest], 10 * TICKS).run(realtime=50.0)
    said = sum((Counter(prank.counts) for prank in BESIDE[: len(BESIDE) - len(left)]), Counter[str]())
    found = Counter({name: result.counts.get(name, 0) for name in said})
    assert (result.ended, result.ticks) == ("duration", 10 * TICKS)
    assert found["wrong_tick_frames"] > 0
    # Where the world was ahead, an answer to the next tick was one, and the honest one came too late.
    del found["wrong_tick_frames"]
    assert not found - said


def test_who_says_that_its_agent_failed_ends_the_run_with_its_words() -> None:
    lies = frame("failed", -1, {}, {"robots": "all\x1b[31m", "traceback": "made up"})
    with pytest.raises(AgentFailed, match="made up"):
        Played(lambda _: [lies]).run()


def test_the_page_lists_each_of_them_with_its_count() -> None:
    told = {what.strip(): set(re.findall(r"`(\w+)`", counted)) for what, counted in ROW.findall(section())}
    assert told == {prank.what: {*prank.counts, *prank.fates} for prank in (EARLY, *BESIDE, *INSTEAD)}


def section() -> str:
    return PAGE.read_text(encoding="utf-8").split("\n## Runners that misbehave\n")[1].split("\n## ")[0]

"""Every entry point for data from outside accepts an input or refuses it by a declared error.

With HYPOTHESIS_PROFILE=soak, as in `make soak`, each gets up to 100,000 inputs.
"""

import ctypes
import gc
from collections import Counter
from pathlib import Path
from typing import Any

import psutil
import pytest
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from tests.tools.fuzz.target import ACCEPTED, ByteTarget, Target, run_case
from tests.tools.fuzz.targets import folders, joining, radio, robots, wire
from tests.tools.fuzz.targets import settings as settings_files

TARGETS: tuple[type[Target], ...] = (
    *(wire.WorldFrames, wire.RunnerFrames, wire.ProcessAnswers, wire.Scenes, wire.Truths),
    *(joining.Join, joining.Offers, joining.Assignments, joining.Control, joining.Replies, joining.PageOrders),
    *(radio.Terms, radio.BridgeReceived, radio.BridgeSent, radio.Packets, radio.Poses, radio.Questions),
    *(robots.Epuck2Commands, robots.Epuck2Answers, robots.Ros2Sensors, robots.Ros2Commands),
    *(settings_files.Scenarios, settings_files.Bodies, settings_files.Campaigns),
    *(settings_files.Fleets, settings_files.RobotSettings, settings_files.Certificates),
    *(folders.RunFolders, folders.CampaignFolders, folders.Traces, folders.RadioLogs, folders.RobotLogs),
)
AVERAGE_CASES = 6  # of an example, if it may have 20
BATCH = 600  # cases, at most a hundredth of a soak; Hypothesis then forgets what it tried
MAX_GROWTH_MB = 64.0  # of memory, from a quarter of a soak to its end
SOAK = settings.get_current_profile_name() == "soak"


def fuzz(target: Target, cases: int, batch: int = 0) -> Counter[str]:
    """Run about so many cases, always the same in a batch of this number: how often each was accepted or refused."""
    kinds: Counter[str] = Counter()

    @settings(
        max_examples=max(1, cases // (AVERAGE_CASES if target.per_example > 1 else 1)),
        phases=(Phase.generate, Phase.shrink),
        report_multiple_bugs=False,
        suppress_health_check=list(HealthCheck),
    )
    @seed(batch)
    @given(st.lists(target.cases(), min_size=1, max_size=target.per_example))
    def feed(cases: list[Any]) -> None:
        for case in cases:
            kinds[run_case(target, case)] += 1

    feed()
    return kinds


def soak(target: Target) -> None:
    """Run many batches; memory does not grow after the first quarter.

    If it did, all cases run once more: a leak takes memory again, a kernel that was compiled does not.
    """
    kinds, grown_mb = _batches(target)
    print(f"{target.name}: {kinds.total()} cases, {kinds[ACCEPTED]} accepted, refused in {len(kinds) - 1} ways")
    if grown_mb > MAX_GROWTH_MB:
        grown_mb = _batches(target)[1]
    assert grown_mb <= MAX_GROWTH_MB


def _batches(target: Target) -> tuple[Counter[str], float]:
    """How often cases were accepted or refused, and by how many MB memory grew after the first quarter."""
    kinds, after_a_quarter_mb, size = Counter[str](), 0.0, min(BATCH, target.soak // 100)
    for batch in range(1, target.soak // size + 1):
        kinds += fuzz(target, size, batch)
        if batch * size <= target.soak // 4:
            after_a_quarter_mb = _memory_mb()
    return kinds, _memory_mb() - after_a_quarter_mb


def _memory_mb() -> float:
    """What the process holds, without free memory that the C library keeps after a large case."""
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)
    return psutil.Process().memory_info().rss / 2**20


@pytest.mark.timeout(0 if SOAK else 120)
@pytest.mark.parametrize("kind", TARGETS, ids=lambda kind: kind.name)
def test_fuzz_case_is_accepted_or_refused_by_a_declared_error(kind: type[Target], tmp_path: Path) -> None:
    target = kind(tmp_path)
    kinds = [run_case(target, sample) for sample in target.samples]
    assert ACCEPTED in kinds, "a sample is accepted"
    assert fuzz(target, target.quick).keys() - {ACCEPTED}, "some are refused"
    if SOAK:
        soak(target)


class Planted(ByteTarget):
    """An entry point with every fault that one may have, each behind a byte of its own."""

    name = "planted"
    quick = 500
    limit_s = 0.3

    def make_samples(self) -> list[bytes]:
        return [b"a packet", b"another"]

    def feed(self, case: bytes) -> None:
        if b"\xff" in case:
            raise KeyError(case)
        if b"\xc1" in case:
            raise BaseException("a panic of native code")
        while b"\x91" in case:
            try:
                len(case)
            except Exception:  # noqa: BLE001 - who swallows all errors must not swallow the time limit
                continue


def test_fuzz_finds_and_shrinks_a_fault(tmp_path: Path) -> None:
    target = Planted(tmp_path)
    with pytest.raises((AssertionError, KeyError), match=r"xff|panic|over 0\.3 s") as caught:
        fuzz(target, target.quick)
    case, again = caught.value.__notes__
    assert case.count("b'") <= 2
    assert "@reproduce_failure" in again


@pytest.mark.parametrize(
    ("case", "message"), [(b"\xff", "xff"), (b"\xc1", "a panic of native code"), (b"\x91", "over 0.3 s")]
)
def test_fuzz_reports_errors_panics_and_endless_loops(tmp_path: Path, case: bytes, message: str) -> None:
    with pytest.raises((AssertionError, KeyError), match=message):
        run_case(Planted(tmp_path), case)

"""Many cases of one target, one after the other: tallies, the slowest, and what was found."""

import gc
import time
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import psutil

from tests.tools.fuzz.dice import Dice
from tests.tools.fuzz.target import ACCEPTED, Target
from tests.tools.fuzz.trial import SHOWN, Finding, tried

MOST_FINDINGS = 20  # of a target: more say the same
GROWTH_MB = 64.0  # from a quarter of the cases to their end
WORTH_MEASURING = 2000  # cases: fewer are still filling caches


@dataclass
class Report:
    """How a target did."""

    target: str
    seed: int
    cases: int = 0
    became: Counter[str] = field(default_factory=Counter[str])
    findings: list[Finding] = field(default_factory=list[Finding])
    slowest_s: float = 0.0
    slowest: int = 0  # number of that case
    spent_s: float = 0.0  # of processor time
    memory_mb: float = 0.0
    growth_mb: float = 0.0  # since a quarter of the cases

    @property
    def accepted(self) -> int:
        """Cases that were let in."""
        return self.became[ACCEPTED]


def fuzz(
    target: Target,
    seed: int,
    numbers: Iterable[int],
    cases: int,
    go_on: Callable[[Report], bool] = lambda _: True,
) -> Report:
    """Try the cases of these numbers, of which there are `cases`, for as long as `go_on` says so."""
    report = Report(target.name, seed)
    measured_from, base_mb = cases // 4, 0.0
    for number in numbers:
        try_one(target, seed, number, report)
        if report.cases == measured_from and cases >= WORTH_MEASURING:
            base_mb = _memory_mb()
        if len(report.findings) >= MOST_FINDINGS or not go_on(report):
            break
    if base_mb:
        report.memory_mb = _memory_mb()
        report.growth_mb = report.memory_mb - base_mb
    if report.growth_mb > GROWTH_MB:
        text = f"memory grew by {report.growth_mb:.0f} MB since case {measured_from}"
        report.findings.append(Finding(target.name, seed, -1, text, ""))
    return report


def try_one(target: Target, seed: int, number: int, report: Report) -> Any:
    """Try one case, and add to the report what became of it; returns the case."""
    case = target.case(Dice(seed, target.name, number))
    before_s = time.process_time()
    became, found = tried(target, case)
    spent_s = time.process_time() - before_s
    report.cases += 1
    report.became[became] += 1
    report.spent_s += spent_s
    if spent_s > report.slowest_s:
        report.slowest_s, report.slowest = spent_s, number
    if found:
        what, _, detail = found.partition("\n")
        report.findings.append(Finding(target.name, seed, number, what, f"{detail}case: {repr(case)[:SHOWN]}"))
    return case


def _memory_mb() -> float:
    gc.collect()
    return psutil.Process().memory_info().rss / 2**20

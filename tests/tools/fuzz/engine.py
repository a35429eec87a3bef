"""Runs Hypothesis on a target: a case is accepted or refused, within limits of time and memory, or it is a finding."""

import gc
import resource
import signal
import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import hypothesis
import psutil
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from tests.tools.fuzz.target import ACCEPTED, Target, refusal_kind

_SHARED: dict[str, Any] = {
    "deadline": None,
    "database": None,
    "phases": (Phase.generate, Phase.shrink),
    "print_blob": True,
    "report_multiple_bugs": False,
    "suppress_health_check": list(HealthCheck),
}
QUICK = settings(derandomize=True, **_SHARED)  # for the test suite
SOAK = settings(derandomize=False, **_SHARED)
AVERAGE_CASES = 6  # of an example, if it may have 20
BATCH = 600  # cases, at most a hundredth of a soak: Hypothesis then forgets what it tried, time and memory are checked
MAX_FINDINGS = 5  # of a target: more say the same
MAX_CASE_MB = 300  # that the peak of the process may grow by in one case
MAX_GROWTH_MB = 64.0  # from a quarter of the cases to their end
MIN_MEASURED = 2000  # cases: fewer are still filling caches
MAX_WIDTH = 400  # of a line of a finding


class TimeLimitExceeded(BaseException):
    """A case over its limit: no handler of errors in the product may catch it."""


@dataclass
class Report:
    """The results of a target."""

    target: str
    kinds: Counter[str] = field(default_factory=Counter[str])  # of what became of the cases
    findings: list[str] = field(default_factory=list[str])
    slowest_s: float = 0.0
    cpu_s: float = 0.0
    growth_mb: float = 0.0

    @property
    def cases(self) -> int:
        """Cases that were run, those of shrinking included."""
        return self.kinds.total()

    @property
    def accepted(self) -> int:
        """Cases that were accepted."""
        return self.kinds[ACCEPTED]


def fuzz(target: Target, profile: settings, cases: int, seed: str = "", blob: str = "") -> Report:
    """Run about so many cases, in examples of up to `per_example`; or the one example of `blob`."""
    report = Report(target.name)
    examples = max(1, cases // (AVERAGE_CASES if target.per_example > 1 else 1))

    @settings(profile, max_examples=examples)
    @given(st.lists(target.cases(), min_size=1, max_size=target.per_example))
    def feed(cases: list[Any]) -> None:
        for case in cases:
            report.kinds["finding"] += 1  # unless it ends well
            before_s = time.process_time()
            kind = run_case(target, case)
            report.slowest_s = max(report.slowest_s, time.process_time() - before_s)
            report.kinds["finding"] -= 1
            report.kinds[kind] += 1

    check: Any = feed
    if blob:
        check = hypothesis.reproduce_failure(hypothesis.__version__, blob.encode())(check)
    elif seed:
        check = hypothesis.seed(seed)(check)
    began_s = time.process_time()
    try:
        check()
    except Exception as error:  # noqa: BLE001 - any error is a finding
        report.findings.append(_described(target, error))
    report.cpu_s = time.process_time() - began_s
    return report


def soak(target: Target, cases: int, seed: int, go_on: Callable[[Report], bool]) -> Report:
    """Run at least so many cases in batches, for as long as `go_on` says so, and measure the growth of memory."""
    report, base_mb, batch = Report(target.name), 0.0, 0
    size = min(BATCH, target.soak // 100, cases)
    while report.cases < cases and len(report.findings) < MAX_FINDINGS and go_on(report):
        part = fuzz(target, SOAK, size, f"{seed}/{target.name}/{batch}")
        report.kinds += part.kinds
        report.findings += part.findings
        report.cpu_s += part.cpu_s
        report.slowest_s = max(report.slowest_s, part.slowest_s)
        batch += 1
        if cases >= MIN_MEASURED and report.cases >= cases // 4:
            memory_mb = _memory_mb()
            base_mb = base_mb or memory_mb
            report.growth_mb = memory_mb - base_mb
    if report.growth_mb > MAX_GROWTH_MB:
        report.findings.append(f"{target.name}: memory grew by {report.growth_mb:.0f} MB after a quarter of the cases")
    return report


def run_case(target: Target, case: Any) -> str:
    """The kind of the refusal, or ACCEPTED; AssertionError or the error itself if it is a finding."""
    before_mb = _peak_mb()
    try:
        with _limited(target.limit_s):
            kind = target.feed(case) or ACCEPTED
    except target.refusals as error:
        kind = refusal_kind(error)
    except TimeLimitExceeded as error:
        raise AssertionError(f"over {target.limit_s:g} s of processor time") from error
    except (Exception, KeyboardInterrupt):
        raise
    except BaseException as error:  # a panic of native code; Hypothesis would not take it for a failure
        raise AssertionError(f"{type(error).__name__}: {error}") from error
    grown_mb = _peak_mb() - before_mb
    if grown_mb > MAX_CASE_MB:
        gc.collect()
        with suppress(OSError):  # Linux: the peak begins anew, so that Hypothesis finds the same again
            Path("/proc/self/clear_refs").write_text("5")
        raise AssertionError(f"{grown_mb} MB at its peak, over {MAX_CASE_MB} MB")
    return kind


@contextmanager
def _limited(limit_s: float) -> Generator[None]:
    """TimeLimitExceeded after so much processor time of this process: the load of others does not count."""

    def stop(_signal: int, _frame: object) -> None:
        raise TimeLimitExceeded

    signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, limit_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def _described(target: Target, error: Exception) -> str:
    """The last lines of the traceback, the shrunk case, and the command that runs it again."""
    lines = "".join(traceback.format_exception(error)).splitlines()
    own = [line for line in lines if "site-packages/hypothesis" not in line]
    blobs = [
        note.split("b'")[1].split("'")[0] for note in getattr(error, "__notes__", ()) if "reproduce_failure" in note
    ]
    again = [f"again: python -m tests.tools.fuzz {target.name} --reproduce {blob}" for blob in blobs]
    return "\n".join([f"{target.name}:", *(line[:MAX_WIDTH] for line in own[-24:]), *again])


def _memory_mb() -> float:
    gc.collect()
    return psutil.Process().memory_info().rss / 2**20


def _peak_mb() -> int:
    """The most memory that this process has had."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak >> (20 if sys.platform == "darwin" else 10)

"""One case, tried under limits: what became of it, or what was found."""

import resource
import signal
import sys
import traceback
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import Any

from tests.tools.fuzz.target import ACCEPTED, Target, refusal_name

MOST_MB = 300  # that the process may grow by at its peak, for one case
SHOWN = 400  # letters of a case


class TooSlow(BaseException):
    """A case over its limit: no handler of errors in the product may catch it."""


@dataclass(frozen=True)
class Finding:
    """A case that was neither accepted nor refused by name."""

    target: str
    seed: int
    number: int
    what: str  # the kind of it, in one line
    detail: str

    def __str__(self) -> str:
        again = f"python -m tests.tools.fuzz {self.target} --seed {self.seed} --only {self.number}"
        return f"{self.target} {self.number}: {self.what}\n{self.detail}\nagain: {again}"


def tried(target: Target, case: Any) -> tuple[str, str]:
    """What became of a case, in a word; and what was found, "" if nothing."""
    before_mb = peak_mb()
    try:
        with _limited(target.limit_s):
            became = target.door(case) or ACCEPTED
    except target.refusals as error:
        became = refusal_name(error)
    except TooSlow:
        return "finding", f"over {target.limit_s:g} s of processor time\n{_last_lines()}"
    except (KeyboardInterrupt, MemoryError):
        raise
    except BaseException as error:  # noqa: BLE001 - that is what is looked for; a panic of native code is no Exception
        return "finding", f"{type(error).__name__}: {str(error)[:SHOWN]}\n{_last_lines()}"
    grown_mb = peak_mb() - before_mb
    if grown_mb > MOST_MB:
        return "finding", f"{grown_mb} MB at its peak, at most {MOST_MB} were expected"
    return became, ""


@contextmanager
def _limited(limit_s: float) -> Generator[None]:
    """TooSlow after so much time of this process's processors: another process's load does not count."""
    signal.signal(signal.SIGPROF, _too_slow)
    signal.setitimer(signal.ITIMER_PROF, limit_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def _too_slow(_signal: int, _frame: FrameType | None) -> None:
    raise TooSlow


def _last_lines() -> str:
    return "".join(traceback.format_exc().splitlines(keepends=True)[-14:])


def peak_mb() -> int:
    """The most memory that this process has ever had."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak >> (20 if sys.platform == "darwin" else 10)

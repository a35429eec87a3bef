"""Fuzzing at length: `python -m tests.tools.fuzz [TARGET…] --cases N --seed S --seconds S`, or one case with `--only`.

Ends with a table, and with 1 if anything was found.
"""

import argparse
import faulthandler
import sys
import tempfile
import warnings
from pathlib import Path

from swarmwire.comms.clock import WallClock, to_s
from tests.tools.fuzz.fuzzing import Report, fuzz, try_one
from tests.tools.fuzz.target import Target
from tests.tools.fuzz.targets.registry import TARGETS

EVERY = 500  # cases between two looks at the time
STUCK_S = 300.0  # of wall time for so many; only native code can hold up a case longer than its limit
CLOCK = WallClock()


def main() -> int:
    """Fuzz what was asked for."""
    asked = _asked()
    warnings.simplefilter("error")
    reports: list[Report] = []
    for name in asked.targets or list(TARGETS):
        with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
            target = TARGETS[name](Path(folder))
            if asked.only is not None:
                reports.append(_one(target, asked.seed, asked.only))
                continue
            reports.append(_many(target, asked.seed, asked.first, asked.cases, asked.seconds))
    faulthandler.cancel_dump_traceback_later()
    _show(reports, asked.tally)
    return int(any(report.findings for report in reports))


def _asked() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.tools.fuzz", description=__doc__)
    parser.add_argument("targets", nargs="*", metavar="TARGET", choices=[[], *TARGETS], help=", ".join(TARGETS))
    parser.add_argument("--cases", type=int, default=100_000, help="of each target")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="for each target at most")
    parser.add_argument("--only", type=int, help="this case alone, and show it")
    parser.add_argument("--tally", action="store_true", help="show every refusal by name")
    return parser.parse_args()


def _one(target: Target, seed: int, number: int) -> Report:
    report = Report(target.name, seed)
    case = try_one(target, seed, number, report)
    print(case if isinstance(case, str) else repr(case))
    print(*report.became)
    return report


def _many(target: Target, seed: int, first: int, cases: int, seconds: float) -> Report:
    began_ns = CLOCK.now_ns()

    def go_on(report: Report) -> bool:
        if report.cases % EVERY:
            return True
        faulthandler.dump_traceback_later(STUCK_S, exit=True)
        told = f"{target.name}: {report.cases} of {cases}, {len(report.findings)} findings"
        print(told, end="\r", file=sys.stderr, flush=True)
        return to_s(CLOCK.now_ns() - began_ns) < seconds

    return fuzz(target, seed, range(first, first + cases), cases, go_on)


def _show(reports: list[Report], tally: bool) -> None:
    for report in reports:
        for finding in report.findings:
            print(f"\n{finding}")
    print(f"\n{'target':<18}{'cases':>9}{'accepted':>10}{'refused':>9}{'names':>7}{'found':>7}", end="")
    print(f"{'slowest':>10}{'case':>9}{'CPU':>8}{'memory':>9}{'growth':>8}")
    for report in reports:
        refused = report.cases - report.accepted - report.became["finding"]
        names = len(report.became.keys() - {"accepted", "finding"})
        print(f"{report.target:<18}{report.cases:>9}{report.accepted:>10}{refused:>9}{names:>7}", end="")
        print(f"{len(report.findings):>7}{report.slowest_s * 1000:>7.0f} ms{report.slowest:>9}", end="")
        print(f"{report.spent_s:>6.0f} s{report.memory_mb:>6.0f} MB{report.growth_mb:>5.0f} MB")
    for report in reports if tally else ():
        print(f"\n{report.target}")
        for name, count in report.became.most_common():
            print(f"{count:>9} {name}")


if __name__ == "__main__":
    sys.exit(main())

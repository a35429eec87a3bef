"""Fuzzing at length: `python -m tests.tools.fuzz [TARGET…] --cases N --seed S --seconds S`.

Prints a table row by row, and exits with 1 if there are findings. `--reproduce BLOB` runs the case of a finding again.
"""

import argparse
import faulthandler
import sys
import tempfile
import warnings
from pathlib import Path

from swarmwire.comms.clock import WallClock, to_s
from tests.tools.fuzz.engine import SOAK, Report, fuzz, soak
from tests.tools.fuzz.target import ACCEPTED, Target
from tests.tools.fuzz.targets.registry import TARGETS

STUCK_S = 900.0  # of wall time for a batch; only native code can hold up a case longer than its limit
CLOCK = WallClock()


def main() -> int:
    """Fuzz the targets."""
    options = _options()
    warnings.simplefilter("error")
    columns = ("cases", "accepted", "refused", "kinds", "findings", "slowest", "CPU", "growth")
    print(f"{'target':<18}" + "".join(f"{column:>10}" for column in columns))
    found = 0
    for name in options.targets or list(TARGETS):
        with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
            target = TARGETS[name](Path(folder))
            if options.reproduce:
                report = fuzz(target, SOAK, 1, blob=options.reproduce)
            else:
                report = _soak(target, options.cases or target.soak, options.seed, options.seconds)
        _show(report, options.refusals)
        found += len(report.findings)
    faulthandler.cancel_dump_traceback_later()
    return int(found > 0)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.tools.fuzz", description=__doc__)
    parser.add_argument("targets", nargs="*", metavar="TARGET", choices=[[], *TARGETS], help=", ".join(TARGETS))
    parser.add_argument("--cases", type=int, help="of each target; default: its own number, mostly 100,000")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=float("inf"), help="for each target at most")
    parser.add_argument("--reproduce", default="", metavar="BLOB", help="the case of a finding")
    parser.add_argument("--refusals", action="store_true", help="count the refusals by kind")
    return parser.parse_args()


def _soak(target: Target, cases: int, seed: int, seconds: float) -> Report:
    began_ns = CLOCK.now_ns()

    def go_on(report: Report) -> bool:
        faulthandler.dump_traceback_later(STUCK_S, exit=True)
        progress = f"{target.name}: {report.cases} of {cases}, {len(report.findings)} findings"
        print(progress, end="\r", file=sys.stderr, flush=True)
        return to_s(CLOCK.now_ns() - began_ns) < seconds

    return soak(target, cases, seed, go_on)


def _show(report: Report, refusals: bool) -> None:
    for finding in report.findings:
        print(f"\n{finding}\n")
    refused = report.cases - report.accepted - report.kinds["finding"]
    kinds = len(report.kinds.keys() - {ACCEPTED, "finding"})
    counts = (report.cases, report.accepted, refused, kinds, len(report.findings))
    print(f"{report.target:<18}" + "".join(f"{count:>10}" for count in counts), end="")
    print(f"{report.slowest_s * 1000:>7.0f} ms{report.cpu_s:>8.0f} s{report.growth_mb:>7.0f} MB", flush=True)
    for kind, count in report.kinds.most_common() if refusals else ():
        print(f"{count:>28} {kind}")


if __name__ == "__main__":
    sys.exit(main())

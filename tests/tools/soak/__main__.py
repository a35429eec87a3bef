"""`python -m tests.tools.soak`: an hour with faults all the time.

`--judge FOLDER` only judges the hour of that folder again. docs/dev/release.md has the results.
"""

import argparse
import json
import os
import shutil
import signal
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import polars as pl

from tests.tools.soak import invariants
from tests.tools.soak.hour import LOCKSTEP, Hour
from tests.tools.soak.invariants import Broken
from tests.tools.soak.samples import growths


def main() -> int:
    """Run the soak; the exit code is 0 if all checks passed."""
    parser = argparse.ArgumentParser("python -m tests.tools.soak", description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--processes", type=int, default=120, help="agent processes of the world in lockstep")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("runs/soak"), help="a folder that is not there yet")
    parser.add_argument("--judge", type=Path, metavar="FOLDER", help="of an hour that is over: only judge it")
    options = parser.parse_args()
    if options.judge:
        return judge(options.judge)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    os.environ["TMPDIR"] = str(options.out.absolute() / "tmp" / "harness")  # sockets of its sessions
    hour = Hour(options.out, options.minutes, options.processes, options.seed)
    Path(os.environ["TMPDIR"]).mkdir()
    hour.run()
    return judge(options.out)


def judge(folder: Path) -> int:
    """Print the result of an hour, and write it into its folder; 0 if all holds."""
    counts = json.loads((folder / "counts.json").read_text())
    growth, checks = growths(pl.read_csv(folder / "samples.csv")), check_all(folder, counts)
    holds = all(item["holds"] for item in (*growth, *checks))
    result = {"holds": holds, "growth": growth, "checks": checks, "counts": counts}
    (folder / "result.json").write_text(json.dumps(result, indent=2) + "\n")
    print(f"{'quantity':58} {'first':>10} {'last':>10} {'growth':>8}")
    for item in growth:
        name, mark = f"{item['process_name']}: {item['quantity']}", "" if item["holds"] else "  GREW"
        print(f"{name:58} {item['first']:10.2f} {item['last']:10.2f} {item['growth']:+8.1%}{mark}")
    for item in checks:
        print(f"{'holds' if item['holds'] else 'BROKEN'}: {item['check']}: {item['text']}")
    print(json.dumps(counts, indent=1))
    return 0 if holds else 1


def check_all(folder: Path, counts: dict[str, Any]) -> list[dict[str, Any]]:
    """Name, outcome and text of every invariant."""
    temporary = folder.absolute() / "tmp"
    shutil.rmtree(temporary / "harness", ignore_errors=True)
    checks: dict[str, Callable[[], str]] = {
        "no process left": partial(invariants.check_no_process, temporary),
        "nothing temporary left": partial(invariants.check_no_file, temporary),
    }
    for run in sorted(folder.glob("*/run")):
        name, summary = run.parent.name, invariants.read_summary(run)
        robots = [f"swarm-{at}" for at in range(summary["robots"])]
        checks |= {
            f"{name}: exit codes": partial(invariants.check_exit_codes, counts[name]["exit codes"]),
            f"{name}: fates": partial(invariants.check_fates, summary),
            f"{name}: owners": partial(invariants.check_owners, summary, robots),
            f"{name}: folder": partial(invariants.check_folder, run),
            f"{name}: repeat": partial(invariants.check_repeat, run),
        }
        if name == LOCKSTEP:
            checks[f"{name}: undisturbed"] = partial(invariants.check_undisturbed, run)
    faults = counts["faults of the soak"]
    itself = {"check": "the soak itself", "holds": not faults, "text": "; ".join(faults) or "no fault of its own"}
    return [*(_outcome(name, check) for name, check in checks.items()), itself]


def _outcome(name: str, check: Callable[[], str]) -> dict[str, Any]:
    try:
        return {"check": name, "holds": True, "text": check()}
    except Broken as broken:
        return {"check": name, "holds": False, "text": str(broken)}


if __name__ == "__main__":
    sys.exit(main())

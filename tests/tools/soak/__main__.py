"""`python -m tests.tools.soak`: random schedules of faults, then an hour with faults all the time.

`--judge FOLDER` only judges the hour of that folder again. docs/dev/fault-evidence.md has the results of both.
"""

import argparse
import json
import os
import shutil
import signal
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from tests.tools.soak import invariants
from tests.tools.soak.hour import Hour
from tests.tools.soak.invariants import Broken
from tests.tools.soak.samples import flatness, read_samples
from tests.tools.soak.schedules import play_all

SCHEDULES_AT_ONCE = 2


def main() -> int:
    """Run the soak; the exit code is 0 if all checks passed."""
    parser = argparse.ArgumentParser("python -m tests.tools.soak", description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--processes", type=int, default=120, help="agent processes of the world in lockstep")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--schedules", type=int, default=200, help="random schedules of faults before it; 0: none")
    parser.add_argument("--out", type=Path, default=Path("runs/soak"), help="a folder that is not there yet")
    parser.add_argument("--judge", type=Path, metavar="FOLDER", help="of an hour that is over: only judge it")
    options = parser.parse_args()
    if options.judge:
        return _judge(options.judge)
    held = (
        play_all(range(options.seed, options.seed + options.schedules), SCHEDULES_AT_ONCE, None)
        if options.schedules
        else 0
    )
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    os.environ["TMPDIR"] = str(options.out.absolute() / "tmp" / "harness")  # sockets of its sessions
    hour = Hour(options.out, options.minutes, options.processes, options.seed)
    Path(os.environ["TMPDIR"]).mkdir()
    hour.run()
    return _judge(options.out) or held


def _judge(folder: Path) -> int:
    result = judge(folder)
    print(text(result))
    return 0 if result["holds"] else 1


LOCKSTEP = "lockstep"


def judge(folder: Path) -> dict[str, Any]:
    """Judge an hour, and write the result into its folder."""
    samples = read_samples(folder / "samples.csv")
    end_s = max(row.at_s for rows in samples.values() for row in rows)
    flat = flatness(samples, end_s)
    held = check_all(folder)
    result = {
        "holds": all(item.holds for item in flat) and all(ok for _, ok, _ in held),
        "minutes": round(end_s / 60.0, 1),
        "flat": [
            {
                "who": item.process_name,
                "what": item.quantity,
                "first": item.first,
                "last": item.last,
                "holds": item.holds,
            }
            for item in flat
        ],
        "checks": [{"what": name, "holds": ok, "told": text} for name, ok, text in held],
        "counts": json.loads((folder / "counts.json").read_text()),
    }
    (folder / "result.json").write_text(json.dumps(result, indent=2) + "\n")
    return result


def check_all(folder: Path) -> list[tuple[str, bool, str]]:
    """Name, outcome and text of every invariant."""
    temporary = folder.absolute() / "tmp"
    shutil.rmtree(temporary / "harness", ignore_errors=True)
    results = [
        _check("no process left", lambda: invariants.check_no_process(temporary, os.getpid())),
        _check("nothing temporary left", lambda: invariants.check_no_file(temporary)),
    ]
    counts = json.loads((folder / "counts.json").read_text())
    faults = counts.pop("faults of the soak")
    results.append(("the soak itself", not faults, "; ".join(faults) or "no fault of its own"))
    for name, text in counts.items():
        results.append(
            _check(f"{name}: exit codes", lambda codes=text["exit codes"]: invariants.check_exit_codes(codes))
        )
    for run in sorted(folder.glob("*/run")):
        name = run.parent.name
        summary = invariants.read_summary(run)
        results += [
            _check(f"{name}: fates", lambda summary=summary: invariants.check_fates(summary)),
            _check(f"{name}: owners", lambda summary=summary: _owners(summary)),
            _check(f"{name}: folder", lambda run=run: invariants.check_folder(run)),
            _check(f"{name}: repeat", lambda run=run: invariants.check_repeat(run)),
        ]
        if name == LOCKSTEP:
            results.append(_check(f"{name}: undisturbed", lambda run=run: invariants.check_undisturbed(run)))
    return results


def _check(name: str, check: Callable[[], str]) -> tuple[str, bool, str]:
    try:
        return name, True, check()
    except Broken as broken:
        return name, False, str(broken)


def _owners(summary: Mapping[str, Any]) -> str:
    return invariants.check_owners(summary, [f"swarm-{at}" for at in range(summary["robots"])])


def text(result: Mapping[str, Any]) -> str:
    """The result as a table."""
    lines = [f"{'what':58} {'first':>10} {'last':>10} {'growth':>8}"]
    for item in result["flat"]:
        growth = item["last"] / item["first"] - 1 if item["first"] else 0.0
        mark = "" if item["holds"] else "  GREW"
        lines.append(
            f"{item['who'] + ': ' + item['what']:58} {item['first']:10.2f} {item['last']:10.2f} {growth:+8.1%}{mark}"
        )
    lines += [f"{'holds' if item['holds'] else 'BROKEN'}: {item['what']}: {item['told']}" for item in result["checks"]]
    lines.append(json.dumps(result["counts"], indent=1))
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())

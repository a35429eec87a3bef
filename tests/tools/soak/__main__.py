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
    """The exit code: 0 if all held."""
    parser = argparse.ArgumentParser("python -m tests.tools.soak", description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--processes", type=int, default=120, help="agent processes of the world in lockstep")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--schedules", type=int, default=200, help="random schedules of faults before it; 0: none")
    parser.add_argument("--out", type=Path, default=Path("runs/soak"), help="a folder that is not there yet")
    parser.add_argument("--judge", type=Path, metavar="FOLDER", help="of an hour that is over: only judge it")
    given = parser.parse_args()
    if given.judge:
        return _judge(given.judge)
    held = play_all(range(given.seed, given.seed + given.schedules), SCHEDULES_AT_ONCE, None) if given.schedules else 0
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    os.environ["TMPDIR"] = str(given.out.absolute() / "tmp" / "harness")  # where its own sessions have their sockets
    hour = Hour(given.out, given.minutes, given.processes, given.seed)
    Path(os.environ["TMPDIR"]).mkdir()
    hour.run()
    return _judge(given.out) or held


def _judge(folder: Path) -> int:
    result = judged(folder)
    print(told(result))
    return 0 if result["holds"] else 1


LOCKSTEP = "lockstep"


def judged(folder: Path) -> dict[str, Any]:
    """All that was found, which is also written into the folder."""
    samples = read_samples(folder / "samples.csv")
    end_s = max(row.at_s for rows in samples.values() for row in rows)
    flat = flatness(samples, end_s)
    held = checks(folder)
    result = {
        "holds": all(one.holds for one in flat) and all(ok for _, ok, _ in held),
        "minutes": round(end_s / 60.0, 1),
        "flat": [
            {"who": one.who, "what": one.what, "first": one.first, "last": one.last, "holds": one.holds} for one in flat
        ],
        "checks": [{"what": what, "holds": ok, "told": text} for what, ok, text in held],
        "counts": json.loads((folder / "counts.json").read_text()),
    }
    (folder / "result.json").write_text(json.dumps(result, indent=2) + "\n")
    return result


def checks(folder: Path) -> list[tuple[str, bool, str]]:
    """Every invariant: whether it holds, and what it says."""
    temporary = folder.absolute() / "tmp"
    shutil.rmtree(temporary / "harness", ignore_errors=True)
    found = [
        _tried("no process left", lambda: invariants.nobody_is_left(temporary, os.getpid())),
        _tried("nothing temporary left", lambda: invariants.nothing_is_left(temporary)),
    ]
    counts = json.loads((folder / "counts.json").read_text())
    faults = counts.pop("faults of the soak")
    found.append(("the soak itself", not faults, "; ".join(faults) or "no fault of its own"))
    for name, told in counts.items():
        found.append(_tried(f"{name}: exit codes", lambda codes=told["exit codes"]: invariants.nobody_crashed(codes)))
    for run in sorted(folder.glob("*/run")):
        name = run.parent.name
        summary = invariants.read_summary(run)
        found += [
            _tried(f"{name}: fates", lambda summary=summary: invariants.fates_add_up(summary)),
            _tried(f"{name}: owners", lambda summary=summary: _owners(summary)),
            _tried(f"{name}: folder", lambda run=run: invariants.folder_is_whole(run)),
            _tried(f"{name}: repeat", lambda run=run: invariants.repeats(run)),
        ]
        if name == LOCKSTEP:
            found.append(_tried(f"{name}: undisturbed", lambda run=run: invariants.undisturbed(run)))
    return found


def _tried(what: str, check: Callable[[], str]) -> tuple[str, bool, str]:
    try:
        return what, True, check()
    except Broken as broken:
        return what, False, str(broken)


def _owners(summary: Mapping[str, Any]) -> str:
    return invariants.owners_are_known(summary, [f"swarm-{at}" for at in range(summary["robots"])])


def told(result: Mapping[str, Any]) -> str:
    """The result as people read it."""
    lines = [f"{'what':58} {'first':>10} {'last':>10} {'growth':>8}"]
    for one in result["flat"]:
        growth = one["last"] / one["first"] - 1 if one["first"] else 0.0
        mark = "" if one["holds"] else "  GREW"
        lines.append(
            f"{one['who'] + ': ' + one['what']:58} {one['first']:10.2f} {one['last']:10.2f} {growth:+8.1%}{mark}"
        )
    lines += [f"{'holds' if one['holds'] else 'BROKEN'}: {one['what']}: {one['told']}" for one in result["checks"]]
    lines.append(json.dumps(result["counts"], indent=1))
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())

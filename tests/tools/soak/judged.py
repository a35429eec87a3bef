"""What a soak comes to, from its folder alone: `python -m tests.tools.soak.judged FOLDER`."""

import json
import os
import shutil
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from tests.tools.soak import invariants
from tests.tools.soak.invariants import Broken
from tests.tools.soak.samples import read_samples
from tests.tools.soak.verdict import flatness

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


def main(folder: Path) -> int:
    """The exit code: 0 if all held."""
    result = judged(folder)
    print(told(result))
    return 0 if result["holds"] else 1


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))

"""`python -m tests.soak.schedules --count 200 --seed 1`: random schedules of faults, each in a process of its own.

A schedule that fails is named with its seed; `--only SEED` plays it alone, and shows what it does.
"""

import argparse
import faulthandler
import json
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

from swarmwire.comms.clock import WallClock, to_s
from tests.soak.invariants import Broken
from tests.soak.schedules.plan import draw
from tests.soak.schedules.play import play
from tests.soak.supervised import family

LIMIT_S = 300.0  # of one schedule, on a machine that is busy


def main() -> int:
    """The exit code: 0 if all held."""
    parser = argparse.ArgumentParser("python -m tests.soak.schedules", description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1, help="of the first; the others follow")
    parser.add_argument("--only", type=int, metavar="SEED", help="this one, here")
    parser.add_argument("--out", type=Path, help="a file for a line of each, as it is over")
    given = parser.parse_args()
    return _one(given.only) if given.only is not None else _all(given.count, given.seed, given.out)


def _one(seed: int) -> int:
    plan = draw(seed)
    print(f"{seed}: {plan}", flush=True)
    faulthandler.dump_traceback_later(LIMIT_S - 10.0)
    folder = Path(tempfile.mkdtemp(prefix="schedule-"))
    try:
        held = play(plan, folder)
    except Broken as broken:
        print(f"BROKEN: {broken}; its files: {folder}")
        return 1
    shutil.rmtree(folder)
    print("held: " + "; ".join(line for line in held if line))
    return 0


def _all(count: int, first: int, out: Path | None) -> int:
    clock, tally, broken = WallClock(), Counter[str](), list[int]()
    for seed in range(first, first + count):
        began_ns = clock.now_ns()
        code, said = _played(seed)
        took_s = to_s(clock.now_ns() - began_ns)
        family_name = draw(seed).family
        tally[f"{family_name}: {'held' if code == 0 else 'BROKEN'}"] += 1
        if code != 0:
            broken.append(seed)
            print(said, flush=True)
        how = "held" if code == 0 else "BROKEN"
        print(f"{seed - first + 1}/{count} seed {seed}: {how}, {family_name}, {took_s:.1f} s", flush=True)
        if out is not None:
            with out.open("a") as file:
                file.write(json.dumps([seed, code, round(took_s, 1), said]) + "\n")
    for name, times in sorted(tally.items()):
        print(f"{name:28} {times}")
    print(f"{count - len(broken)} of {count} held" + (f"; broken: {broken}" if broken else ""))
    return 1 if broken else 0


def _played(seed: int) -> tuple[int, str]:
    """Exit code and output of a schedule in a process of its own; -1: it hung."""
    command = [sys.executable, "-m", "tests.soak.schedules", "--only", str(seed)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        try:
            said, _ = process.communicate(timeout=LIMIT_S)
        except subprocess.TimeoutExpired:
            for one in family(process.pid):
                one.kill()
            process.kill()
            said, _ = process.communicate()
            return -1, f"{said}\nhung: not over after {LIMIT_S:g} s"
    return process.returncode, said


if __name__ == "__main__":
    sys.exit(main())

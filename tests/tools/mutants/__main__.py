"""Mutation testing: what of the groups was killed, and what survived; ends with 1 if too little was killed.

`python -m tests.tools.mutants [MODULE …] [--each N]`; modules as in `groups.py`, all if none is named. Of survivors, what
nobody looked at is listed: `survivors.toml` holds the rest, each with the reason why it stays.
"""

import argparse
import json
import os
import subprocess
import sys
import tomllib
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from tests.tools.mutants.groups import GROUPS, LEAST_KILLED

SURVIVORS = Path(__file__).parent / "survivors.toml"
Tried = list[dict[str, Any]]  # of a module: line, before, after, killed, took_s


def looked_at() -> dict[tuple[str, str, str], str]:
    """By module, line as it is and line as it is changed: why the survivor stays."""
    listed: list[dict[str, str]] = tomllib.loads(SURVIVORS.read_text())["survivor"]
    return {(one["module"], one["before"], one["after"]): one["why"] for one in listed}


def main(arguments: Sequence[str]) -> int:
    """Try all that is asked for, and tell."""
    parser = argparse.ArgumentParser(prog="python -m tests.tools.mutants", description="mutation testing")
    parser.add_argument("modules", nargs="*", metavar="MODULE", help="as in tests/tools/mutants/groups.py")
    parser.add_argument("--each", type=int, default=1, help="mutants of each place and kind of change")
    asked = parser.parse_args(arguments)
    named = [name for group in GROUPS.values() for name in group]
    if unknown := set(asked.modules) - set(named):
        parser.error(f"expected modules among {', '.join(named)}; got {', '.join(sorted(unknown))}")
    chosen = asked.modules or named
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        tried = dict(zip(chosen, pool.map(lambda name: _tried(name, asked.each), chosen), strict=True))
    enough = [_told(title, {name: tried[name] for name in group if name in tried}) for title, group in GROUPS.items()]
    return 0 if all(enough) else 1


def _tried(module: str, each: int) -> Tried:
    """One module in a process of its own, with the compiler off: else each mutant of a kernel is compiled."""
    command = [sys.executable, "-m", "tests.tools.mutants.one", module, str(each)]
    plain = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(command, check=False, env=plain, capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(f"{module}: {done.stdout}{done.stderr}")
    tried: Tried = [json.loads(line) for line in done.stdout.splitlines()]
    print(f"{module:24} {sum(one['killed'] for one in tried):5} of {len(tried):4} killed", flush=True)
    return tried


def _told(title: str, tried: dict[str, Tried]) -> bool:
    """Print what became of a group; whether enough was killed."""
    if not tried:
        return True
    known = looked_at()
    every = [(name, one) for name, of in tried.items() for one in of]
    left = [(name, one) for name, one in every if not one["killed"]]
    share = 1.0 - len(left) / len(every)
    took_s = sum(one["took_s"] for _, one in every)
    print(
        f"\n{title}: {len(every) - len(left)} of {len(every)} killed, {share:.1%}; {took_s / 60:.0f} min of a processor"
    )
    for name, one in left:
        if (name, one["before"], one["after"]) not in known:
            print(f"  not looked at: {name} {one['line']}: {one['before']}\n      became {one['after']}")
    if share < LEAST_KILLED:
        print(f"  expected {LEAST_KILLED:.0%}")
    return share >= LEAST_KILLED


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

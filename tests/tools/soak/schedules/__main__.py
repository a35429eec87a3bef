"""`python -m tests.tools.soak.schedules --count 200 --seed 1`: random schedules of faults, each in its own process.

A schedule that fails is named with its seed; `--only SEED` plays it alone, and shows what it does.
"""

import argparse
import sys
from pathlib import Path

from tests.tools.soak.schedules.playing import play_all, play_one


def main() -> int:
    """The exit code: 0 if all held."""
    parser = argparse.ArgumentParser("python -m tests.tools.soak.schedules", description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1, help="of the first; the others follow")
    parser.add_argument("--jobs", type=int, default=2, help="how many are played at the same time")
    parser.add_argument("--only", type=int, metavar="SEED", help="this one, here")
    parser.add_argument("--out", type=Path, help="a file for a line of each, as it is over")
    given = parser.parse_args()
    if given.only is not None:
        return play_one(given.only)
    return play_all(range(given.seed, given.seed + given.count), given.jobs, given.out)


if __name__ == "__main__":
    sys.exit(main())

"""`python -m tests.tools.soak`: random schedules of faults, then an hour with faults all the time.

docs/reliability.md tells what came of it.
"""

import argparse
import os
import signal
import sys
from pathlib import Path

from tests.tools.soak.hour import Hour
from tests.tools.soak.judged import main as stop_conditions
from tests.tools.soak.schedules.playing import play_all

SCHEDULES_AT_ONCE = 2


def main() -> int:
    """The exit code: 0 if all held."""
    parser = argparse.ArgumentParser("python -m tests.tools.soak", description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--processes", type=int, default=100, help="runners of the world in lockstep")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--schedules", type=int, default=200, help="random schedules of faults before it; 0: none")
    parser.add_argument("--out", type=Path, default=Path("runs/soak"), help="a folder that is not there yet")
    given = parser.parse_args()
    held = play_all(range(given.seed, given.seed + given.schedules), SCHEDULES_AT_ONCE, None) if given.schedules else 0
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    os.environ["TMPDIR"] = str(given.out.absolute() / "tmp" / "harness")  # where its own sessions have their sockets
    hour = Hour(given.out, given.minutes, given.processes, given.seed)
    Path(os.environ["TMPDIR"]).mkdir()
    hour.run()
    return stop_conditions(given.out) or held


if __name__ == "__main__":
    sys.exit(main())

"""`python -m tests.tools.soak.schedules --count 200 --seed 1`: random schedules of faults, each in its own process.

A schedule that fails is named with its seed; `--only SEED` plays it alone, and shows what it does.

One that passes a time limit, and breaks nothing else, is played once more after all others, alone. If it holds then,
it was starved: it had too little of the machine. Any other broken invariant counts at once.
"""

import argparse
import contextlib
import faulthandler
import json
import os
import shutil
import signal
import sys
import tempfile
import threading
import traceback
from collections import Counter
from collections.abc import Generator, Iterable
from dataclasses import dataclass
from pathlib import Path

from swarmwire.comms.base.clock import WallClock, to_ns, to_s
from tests.tools.soak.invariants import Broken, Late
from tests.tools.soak.plan import draw
from tests.tools.soak.plays import play
from tests.tools.soak.processes import family


def main() -> int:
    """Play schedules; the exit code is 0 if all passed."""
    parser = argparse.ArgumentParser("python -m tests.tools.soak.schedules", description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1, help="of the first; the others follow")
    parser.add_argument("--jobs", type=int, default=2, help="how many are played at the same time")
    parser.add_argument("--only", type=int, metavar="SEED", help="this one, here")
    parser.add_argument("--out", type=Path, help="a file for a line of each, as it is over")
    options = parser.parse_args()
    if options.only is not None:
        return play_one(options.only)
    return play_all(range(options.seed, options.seed + options.count), options.jobs, options.out)


LIMIT_S = 600.0  # limit of one schedule on a busy machine
EACH_S = 0.05
HELD, BROKEN, LATE, HUNG = 0, 1, 3, -1
WORDS = {HELD: "held", LATE: "LATE", HUNG: "HUNG"}  # all other exit codes: BROKEN


@dataclass(frozen=True)
class Playing:
    """A schedule that is being played."""

    seed: int
    log: Path
    began_ns: int


def play_one(seed: int) -> int:
    """Play a schedule in this process; HELD, BROKEN or LATE."""
    plan = draw(seed)
    print(f"{seed}: {plan}", flush=True)
    faulthandler.dump_traceback_later(LIMIT_S - 10.0)
    folder = Path(tempfile.mkdtemp(prefix="schedule-"))
    try:
        held = play(plan, folder)
    except Broken as broken:
        code = LATE if isinstance(broken, Late) else BROKEN
        print(f"{'LATE' if code == LATE else 'BROKEN'}: {broken}; its files: {folder}", flush=True)
        return code
    finally:
        faulthandler.cancel_dump_traceback_later()
    shutil.rmtree(folder)
    print("held: " + "; ".join(held), flush=True)
    return 0


def play_all(seeds: Iterable[int], jobs: int, out: Path | None) -> int:
    """Play all, so many at the same time, then those that were late once more, alone: 0 if all held or were starved."""
    tally, broken, late = Counter[str](), list[int](), list[int]()
    to_come = list(seeds)
    count = len(to_come)
    for seed, code in _played(to_come, jobs, out):
        late += [seed] * (code in (LATE, HUNG))
        broken += [seed] * (code not in (HELD, LATE, HUNG))
        tally[f"{draw(seed).family}: {WORDS.get(code, 'BROKEN')}"] += 1
        print(f"{sum(tally.values())}/{count}", flush=True)
    again = dict(_played(late, 1, out))
    broken += [seed for seed, code in again.items() if code != HELD]
    starved = [seed for seed, code in again.items() if code == HELD]
    for name, times in sorted(tally.items()):
        print(f"{name:24} {times}")
    print(f"{count - len(broken)} of {count} held; starved, and held when played alone: {starved}; broken: {broken}")
    return 1 if broken else 0


def _played(seeds: list[int], jobs: int, out: Path | None) -> Generator[tuple[int, int]]:
    """Play these, so many at the same time: the seed and exit code of each as it is over."""
    clock, to_come, now = WallClock(), list(seeds), dict[int, Playing]()
    with tempfile.TemporaryDirectory(prefix="schedules-") as folder:
        while to_come or now:
            while to_come and len(now) < jobs:
                seed = to_come.pop(0)
                log = Path(folder, str(seed))
                now[_started(seed, log)] = Playing(seed, log, clock.now_ns())
            for pid, playing in list(now.items()):
                took_ns = clock.now_ns() - playing.began_ns
                code = _code(pid, is_late=took_ns > to_ns(LIMIT_S))
                if code is None:
                    continue
                del now[pid]
                log, how = playing.log.read_text(errors="replace"), WORDS.get(code, "BROKEN")
                if code != HELD:
                    print(log)
                print(f"seed {playing.seed}: {how}, {draw(playing.seed).family}, {to_s(took_ns):.1f} s", flush=True)
                if out is not None:
                    with out.open("a") as file:
                        file.write(json.dumps([playing.seed, code, round(to_s(took_ns), 1), log]) + "\n")
                yield playing.seed, code
            threading.Event().wait(EACH_S)


def _started(seed: int, log: Path) -> int:
    """The process id of a child that plays a schedule. This process has no session of zenoh, or the child had none."""
    sys.stdout.flush()
    child = os.fork()
    if child:
        return child
    code = 1
    try:
        output = os.open(log, os.O_WRONLY | os.O_CREAT)
        os.dup2(output, 1)
        os.dup2(output, 2)
        signal.signal(signal.SIGHUP, signal.SIG_DFL)  # nohup's would make the schedule's processes deaf to it, too
        code = play_one(seed)
    except BaseException:  # noqa: BLE001 - the last frame of this process
        traceback.print_exc()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def _code(pid: int, *, is_late: bool) -> int | None:
    """The exit code of a child; None while it goes on. One that is late is killed with all that it started."""
    ended, status = os.waitpid(pid, os.WNOHANG)
    if ended:
        return os.waitstatus_to_exitcode(status)
    if not is_late:
        return None
    for playing in family(pid):
        with contextlib.suppress(Exception):
            playing.kill()
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)
    return HUNG


if __name__ == "__main__":
    sys.exit(main())

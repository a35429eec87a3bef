"""What a machine's first run has to compile: seconds of a core beyond those of the next one."""

import os
import subprocess
import sys
from tempfile import TemporaryDirectory

from benchmarks.lines import print_line
from swarmwire.comms.clock import WallClock, to_s

CASES = {  # scenarios of the repository, cut to a second
    "compile-world": "scenarios/avoidance.toml",
    "compile-disk": "scenarios/flocking-lossy.toml",
    "compile-signals": "scenarios/flocking-802154.toml",
}


def first_compile(name: str, repeats: int) -> None:
    """Seconds that a run with nothing compiled takes beyond those of the same run again. Once: that is a minute."""
    with TemporaryDirectory() as cache:
        first_s, again_s = (_run_s(CASES[name], cache) for _ in range(2))
    print_line(name, first_s - again_s, "s", {"scenario": CASES[name], "again_s": round(again_s, 3)})


def _run_s(scenario: str, cache: str) -> float:
    clock = WallClock()
    called_ns = clock.now_ns()
    code = f"from swarmwire.deploy import run; run({scenario!r}, overrides=['duration_s=1'])"
    environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
    subprocess.run([sys.executable, "-c", code], env=environment, check=True)
    return to_s(clock.now_ns() - called_ns)

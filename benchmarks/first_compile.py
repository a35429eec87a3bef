"""What a machine's first run has to compile: processor time beyond that of the next one."""

import os
import resource
import subprocess
import sys
from tempfile import TemporaryDirectory

from benchmarks.lines import print_line

CASES = {  # scenarios of the repository, cut to a second
    "compile-world": "scenarios/avoidance.toml",
    "compile-disk": "scenarios/flocking-lossy.toml",
    "compile-signals": "scenarios/flocking-802154.toml",
}


def first_compile(name: str, repeats: int) -> None:
    """Processor time that a run with nothing compiled takes beyond the same run again. Once: that is a minute."""
    with TemporaryDirectory() as cache:
        first_s, again_s = (_run_s(CASES[name], cache) for _ in range(2))
    print_line(name, first_s - again_s, "s", {"scenario": CASES[name], "again_s": round(again_s, 3)})


def _run_s(scenario: str, cache: str) -> float:
    before_s = _children_s()
    code = f"from swarmwire.deploy import run; run({scenario!r}, overrides=['duration_s=1'])"
    environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
    subprocess.run([sys.executable, "-c", code], env=environment, check=True)
    return _children_s() - before_s


def _children_s() -> float:
    """Processor time of all child processes that ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime

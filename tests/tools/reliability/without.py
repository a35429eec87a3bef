"""Proves the fault table: each test passes, and fails without the handling that its row names.

    python -m tests.tools.reliability.without [PATTERN…]  only those with a pattern in process, test or source

The part that handles a fault is copied to a folder of its own, changed there, and put before all others on the
path of Python, for the test and for every process that it starts. The project itself stays as it is.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import psutil

from swarmwire.comms.clock import WallClock
from tests.tools.reliability.fault_table import ROOT, Proof, processes
from tests.tools.reliability.one_test import OPTIONS

FAILED = 1  # pytest's exit code when tests ran and failed; a higher one means that they did not run
FAILURES = (" failed", "+ Timeout +")  # in its output; errors of what a test stands on are none
MOST_S = 300.0  # of a test with all that it waits for
ALL_MOST_S = 3600.0  # of all of them together
AT_ONCE = 2  # most of their time they wait
TELLING_LINES = 25


@dataclass(frozen=True)
class Verdict:
    """What came of a proof: nothing is wrong if it holds."""

    seconds: float
    wrong: str = ""


def main(*patterns: str) -> int:
    """Try the proofs, tell of each, and return how many do not hold."""
    chosen = _chosen(patterns or ("",))
    if not chosen:
        print(f"no proof has {' or '.join(patterns)} in the name of process, test or source")
        return 1
    tests = list(dict.fromkeys(proof.test for _, proof in chosen))
    code, text = _run(("pytest", *OPTIONS, *tests), os.environ, ALL_MOST_S)
    print(f"{len(tests)} tests as things are: {text.splitlines()[-1]}", flush=True)
    if code:
        print(text)
        return 1
    wrong = 0
    with ThreadPoolExecutor(AT_ONCE) as pool:
        for (row, proof), verdict in zip(chosen, pool.map(tried, (proof for _, proof in chosen)), strict=True):
            wrong += bool(verdict.wrong)
            told = "DOES NOT HOLD" if verdict.wrong else "holds"
            print(f"{told:13} {verdict.seconds:6.1f} s  {row}: {proof.test}, {proof.file}", flush=True)
            if verdict.wrong:
                print(verdict.wrong, flush=True)
    print(f"{len(chosen)} proofs of {len({row for row, _ in chosen})} faults, {wrong} of which do not hold")
    return wrong


def _chosen(patterns: tuple[str, ...]) -> list[tuple[str, Proof]]:
    """Proofs, each with the row that it is of."""
    return [
        (f"{process.title}, {fault.fault}", proof)
        for process in processes()
        for fault in process.faults
        for proof in fault.proof
        if any(pattern in f"{process.name} {proof.test} {proof.file}" for pattern in patterns)
    ]


def tried(proof: Proof) -> Verdict:
    """What is wrong with the test when the handling is gone: nothing, if it fails."""
    clock = WallClock()
    start_ns = clock.now_ns()
    with TemporaryDirectory(prefix="without-", ignore_cleanup_errors=True) as folder:
        environment = os.environ | {"PYTHONPATH": folder, "PYTHONUNBUFFERED": "1"}
        module = _changed_copy(proof, Path(folder))
        try:
            code, text = _run(("tests.tools.reliability.one_test", module, folder, proof.test), environment, MOST_S)
        finally:
            _end_all_of(folder)
    fails = code == FAILED and any(mark in text for mark in FAILURES)
    wrong = "" if fails else f"without the handling it does not fail (exit code {code}):\n{text}"
    return Verdict((clock.now_ns() - start_ns) / 1e9, wrong)


def _changed_copy(proof: Proof, folder: Path) -> str:
    """The part with its change, below a folder that is a place for the namespace `swarmwire`; the module's name."""
    part, *inner = Path(proof.file).parts
    source = ROOT / part / "swarmwire" / part
    shutil.copytree(source, folder / "swarmwire" / part)  # with its caches and times, so that kernels stay compiled
    changed = folder.joinpath(*inner)
    changed.write_text(proof.changed(), encoding="utf-8")
    return ".".join(Path(*inner).with_suffix("").parts)


def _run(module: tuple[str, ...], environment: Mapping[str, str], most_s: float) -> tuple[int, str]:
    """Exit code of a module with its arguments, and the last that it printed; -1: it took too long."""
    try:
        done = subprocess.run(
            [sys.executable, "-m", *module],
            cwd=ROOT,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=most_s,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return -1, f"it took more than {most_s:.0f} s"
    return done.returncode, "\n".join(done.stdout.splitlines()[-TELLING_LINES:])


def _end_all_of(folder: str) -> None:
    """End what a test that was cut short has left: whatever has the folder in its environment."""
    for process in psutil.process_iter():
        with suppress(psutil.Error):
            if folder in process.environ().get("PYTHONPATH", ""):
                process.kill()


if __name__ == "__main__":
    sys.exit(min(main(*sys.argv[1:]), 1))

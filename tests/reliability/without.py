"""Proves the fault table: each test passes, and fails without the handling that its row names.

    python -m tests.reliability.without [PATTERN]    only proofs with this in the name of process, test or source

The part that handles a fault is copied to a folder of its own, changed there, and put before all others on the
path of Python, for the test and for every process that it starts. The project itself stays as it is.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import psutil

from swarmwire.comms.clock import WallClock
from tests.reliability.fault_table import ROOT, Process, Proof, processes

FAILED = 1  # pytest's exit code when tests ran and failed; a higher one means that they did not run
FAILURES = (" failed", "+ Timeout +")  # in its output; errors of what a test stands on are none
PYTEST = ("pytest", "-q", "-x", "-p", "no:cacheprovider", "--tb=short", "--timeout=120")
MOST_S = 180.0  # of a test with all that it waits for; pytest ends one that hangs after --timeout
TELLING_LINES = 25


@dataclass(frozen=True)
class Verdict:
    """What came of a proof: nothing to tell of if it holds."""

    seconds: float
    wrong: str = ""


def main(pattern: str = "") -> int:
    """Try the proofs one after the other, tell of each, and return how many do not hold."""
    wrong = 0
    tried = 0
    passing: dict[str, str] = {}
    for process, fault, proof in _chosen(pattern):
        verdict = tried_proof(proof, passing)
        tried += 1
        wrong += bool(verdict.wrong)
        told = "DOES NOT HOLD" if verdict.wrong else "holds"
        print(f"{told:13} {verdict.seconds:6.1f} s  {process.title}, {fault}: {proof.test}, {proof.file}", flush=True)
        if verdict.wrong:
            print(verdict.wrong, flush=True)
    print(f"{tried} proofs, {wrong} of which do not hold")
    return wrong


def _chosen(pattern: str) -> list[tuple[Process, str, Proof]]:
    return [
        (process, fault.fault, proof)
        for process in processes()
        for fault in process.faults
        for proof in fault.proof
        if pattern in f"{process.name} {proof.test} {proof.file}"
    ]


def tried_proof(proof: Proof, passing: dict[str, str]) -> Verdict:
    """Whether the test passes as things are, and fails without the handling. `passing` keeps what is known of tests."""
    clock = WallClock()
    start_ns = clock.now_ns()
    if proof.test not in passing:
        code, text = _run((*PYTEST, proof.test), os.environ)
        passing[proof.test] = "" if code == 0 else f"it does not pass as things are:\n{text}"
    wrong = passing[proof.test] or _without(proof)
    return Verdict((clock.now_ns() - start_ns) / 1e9, wrong)


def _without(proof: Proof) -> str:
    """What is wrong with the test when the handling is gone: nothing, if it fails."""
    with TemporaryDirectory(prefix="without-") as folder:
        environment = os.environ | {"PYTHONPATH": folder, "PYTHONUNBUFFERED": "1"}
        module = _changed_copy(proof, Path(folder))
        try:
            code, text = _run(("-c", f"import {module}, sys; print(sys.modules['{module}'].__file__)"), environment)
            if code or folder not in text:
                return f"what is left of {proof.file} cannot be loaded:\n{text}"
            code, text = _run((*PYTEST, proof.test), environment)
        finally:
            _end_all_of(folder)
    if code == FAILED and any(mark in text for mark in FAILURES):
        return ""
    return f"without the handling it does not fail (exit code {code}):\n{text}"


def _changed_copy(proof: Proof, folder: Path) -> str:
    """The part with its change, below a folder that is a place for the namespace `swarmwire`; the module's name."""
    part, *inner = Path(proof.file).parts
    source = ROOT / part / "swarmwire" / part
    shutil.copytree(source, folder / "swarmwire" / part)  # with its caches and times, so that kernels stay compiled
    changed = folder.joinpath(*inner)
    changed.write_text(proof.changed(), encoding="utf-8")
    return ".".join(Path(*inner).with_suffix("").parts)


def _run(command: tuple[str, ...], environment: Mapping[str, str]) -> tuple[int, str]:
    """Exit code and the last that was printed."""
    arguments = command if command[0] == "-c" else ("-m", *command)
    try:
        done = subprocess.run(
            [sys.executable, *arguments],
            cwd=ROOT,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=MOST_S,
            check=False,
        )
    except subprocess.TimeoutExpired as error:  # a test that failed may leave a thread that never ends
        text = _end(error.stdout.decode() if isinstance(error.stdout, bytes) else "")
        return FAILED if " failed" in text else -1, f"{text}\nit took more than {MOST_S:.0f} s"
    return done.returncode, _end(done.stdout)


def _end(text: str) -> str:
    return "\n".join(text.splitlines()[-TELLING_LINES:])


def _end_all_of(folder: str) -> None:
    """End what a test that was cut short has left: whatever has the folder in its environment."""
    for process in psutil.process_iter():
        with suppress(psutil.Error):
            if folder in process.environ().get("PYTHONPATH", ""):
                process.kill()


if __name__ == "__main__":
    sys.exit(min(main(*sys.argv[1:2]), 1))

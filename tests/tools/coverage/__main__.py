"""How much of comms, world and agent the tests run: `python -m tests.tools.coverage`, or `make coverage`.

Twice: tests of kernels with these as plain Python, in which they can be looked at, and tests of all else as users run
them. What both saw is put together. It fails if a test does, or if too few lines or branches were run.
"""

import json
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

DATA = Path(".coverage")
ENOUGH = {"lines": 0.95, "branches": 0.90}
# A worker that is killed at a time-out takes along what it has seen: the limit is for those that hang for ever.
PYTEST = ["-m", "pytest", "-q", "-m", "not slow", "-n", "2", "--dist", "worksteal", "--timeout", "900"]
# Network errors, as in `make test-all`; and waits that run out, since tracing slows the program.
AGAIN = ["--reruns", "1", "--only-rerun", "ZError", "--only-rerun", "it did not come to hold"]
PLAIN = ["-p", "tests.tools.coverage.plain_kernels", "tests/unit/comms", "tests/unit/world"]
THREADS = ["-p", "tests.tools.coverage.network_threads"]
UNITS = [
    *(f"tests/unit/{folder}" for folder in ("agent", "comms/base/test_kernels.py", "comms/wire", "world/backends")),
    *map(str, Path("tests/unit/world").glob("test_*.py")),  # gateways, interfaces, …
]
PROCESSES = [f"tests/integration/{part}" for part in ("agent", "robots", "comms", "world", "deploy/interfaces")]
AS_USED = [*THREADS, *UNITS, *PROCESSES]
PARTS = ("comms", "world", "agent")
COUNTS = {"lines": ("covered_lines", "num_statements"), "branches": ("covered_branches", "num_branches")}


def main() -> int:
    """Run, put together, and tell; 1 if a test failed or there was too little."""
    shutil.rmtree(DATA, ignore_errors=True)
    DATA.mkdir()
    failed = _coverage("run", *PYTEST, *PLAIN) + _coverage("run", *PYTEST, *AGAIN, *AS_USED)
    _coverage("combine", "-q")
    _coverage("json", "-q", "-o", str(DATA / "all.json"))
    _coverage("html", "-q", "-d", str(DATA / "pages"))
    of_parts = _shares(DATA / "all.json")
    for name, shares in of_parts.items():
        print(f"{name:9} lines {shares['lines']:6.1%}  branches {shares['branches']:6.1%}")
    enough = all(shares[unit] >= least for shares in of_parts.values() for unit, least in ENOUGH.items())
    if not enough:
        print(
            f"expected {ENOUGH['lines']:.0%} of lines, {ENOUGH['branches']:.0%} of branches of each; see {DATA}/pages"
        )
    return 0 if enough and not failed else 1


def _coverage(*arguments: str) -> int:
    return subprocess.run([sys.executable, "-m", "coverage", *arguments], check=False).returncode


def _shares(report: Path) -> dict[str, dict[str, float]]:
    """The shares of lines and branches that were run, of each part and of all together."""
    files: dict[str, Any] = json.loads(report.read_text(encoding="utf-8"))["files"]
    sums: dict[str, Counter[str]] = {name: Counter() for name in (*PARTS, "together")}
    for path, file in files.items():
        part = Path(path).parts[Path(path).parts.index("swarmwire") + 1]
        for name in (part, "together"):
            sums[name].update({key: file["summary"][key] for pair in COUNTS.values() for key in pair})
    return {
        name: {unit: counts[run] / counts[all_] for unit, (run, all_) in COUNTS.items()}
        for name, counts in sums.items()
    }


if __name__ == "__main__":
    sys.exit(main())

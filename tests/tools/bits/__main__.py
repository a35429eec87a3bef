"""`python -m tests.tools.bits [NAME …]`: hash every shipped scenario, and compare with the committed hashes.

A line of `hashes.txt` has a scenario, the first half of its trajectory's hash, and the fates of its packets, over
SECONDS of simulated time. `--write` writes the file anew, after a change that is meant to change runs.
"""

import os
import sys
from pathlib import Path

from swarmwire.deploy import run

ROOT = Path(__file__).parents[3]
HASHES = Path(__file__).with_name("hashes.txt")
FOLDERS = ("scenarios", "scenarios/behaviours", "scenarios/robots", "examples/beacons", "examples/gas", "examples/ways")
SECONDS = 3.0
DIGITS = 32  # of the hash, half of them
PER_MACHINE_TYPE = "pymunk"  # an engine in C, whose compiler may contract what it computes


def scenarios() -> list[str]:
    """Return the shipped scenarios that are runs of their own, by their paths from the root."""
    files = [file for folder in FOLDERS for file in sorted((ROOT / folder).glob("*.toml"))]
    return [str(file.relative_to(ROOT)) for file in files if "[arena]" in file.read_text(encoding="utf-8")]


def line_of(scenario: str) -> str | None:
    """Run a scenario and return its line; None for an engine whose runs are equal on one type of machine alone."""
    result = run(scenario, overrides=[f"duration_s={SECONDS}"])
    if result.ended == "interrupted":  # by a signal, also that of a time limit: no line, and no other run
        raise KeyboardInterrupt
    if PER_MACHINE_TYPE in result.engine:
        return None
    words = [scenario]
    for arena in result.arenas:
        words.append(arena.trajectory_sha256[:DIGITS])
        if arena.radio is not None:
            words += [f"{fate}={count}" for fate, count in arena.radio.fates.items() if count]
    return " ".join(words)


def main(arguments: list[str]) -> int:
    """Run the scenarios; return 1 if a line differs from the committed one."""
    os.chdir(ROOT)
    writes = "--write" in arguments
    selected = [name for name in arguments if name != "--write"]
    names = selected or scenarios()
    committed = {line.split(" ")[0]: line for line in HASHES.read_text(encoding="utf-8").splitlines()}
    different = 0
    lines = {name: line for name, line in committed.items() if selected and name not in selected}
    compared = 0
    for name in names:
        if (line := line_of(name)) is not None:
            lines[name] = line
            is_same = line == committed.get(name)
            different += not is_same
            compared += 1
            print("same " if is_same else "OTHER", line, flush=True)
    if writes:
        HASHES.write_text("".join(f"{line}\n" for line in lines.values()), encoding="utf-8")
        return 0
    missing = committed.keys() - lines.keys()
    for name in sorted(missing):
        print("GONE ", name, flush=True)
    print(f"{compared - different} of {compared} equal", flush=True)
    return int(different > 0 or len(missing) > 0 or compared == 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

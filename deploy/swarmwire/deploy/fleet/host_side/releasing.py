"""Releases on a host: try one, make it the current one in one step, go back, remove what nobody needs."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

from swarmwire.deploy.fleet.host_side.files import (
    KEPT,
    PART,
    Refusal,
    current,
    environment,
    part_of,
    releases,
    root,
    sync_folder,
    whole_in,
    write_whole,
)
from swarmwire.deploy.fleet.host_side.system import install_unit, shown

LINES = 5  # of what a failed trial printed


def clear_parts(robots: list[str]) -> None:
    """Remove what interrupted deployments left behind."""
    for folder in (environment("x").parent, *map(releases, robots)):
        for path in folder.glob(f"*{PART}"):
            shutil.rmtree(path, ignore_errors=True)


def try_out(robot: str, release: str, packages: list[str], command: list[str], timeout_s: float) -> None:
    """Run a release that is not whole yet as it would be run, though without its robot; Refusal, and it is removed."""
    part = part_of(releases(robot) / release)
    try:
        paths = os.pathsep.join(str(part / name) for name in packages)
        done = subprocess.run(
            [sys.executable, *command],
            cwd=part,
            env={**os.environ, "PYTHONPATH": paths},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            check=False,
            timeout=timeout_s,
        )
        if done.returncode:
            lines = (done.stderr or done.stdout).strip().splitlines()[-LINES:]
            raise Refusal("trial", "\n".join(lines) or f"ended with {done.returncode}")
    except subprocess.TimeoutExpired:
        shutil.rmtree(part, ignore_errors=True)
        raise Refusal("trial", f"takes longer than {timeout_s:g} s") from None
    except BaseException:  # an exit, too: a half-made folder is left by nobody
        shutil.rmtree(part, ignore_errors=True)
        raise


def switch(robot: str, release: str, past: list[str] | None = None) -> None:
    """Make a release the current one, from one moment to the next: what starts before has all of the old one.

    `past` are the releases that it comes after: all so far, if not given.
    """
    whole = releases(robot) / release
    part = part_of(whole)
    if whole.is_dir():
        shutil.rmtree(part, ignore_errors=True)
    else:
        part.rename(whole)
        sync_folder(whole.parent)
    install_unit(robot, release)
    past = [name for name in (history(robot) if past is None else past) if name != release]
    write_whole(root() / robot / "history", json.dumps([*past, release]))
    link = root() / robot / f"current{PART}"
    link.unlink(missing_ok=True)
    link.symlink_to(Path("releases") / release)
    link.replace(root() / robot / "current")
    sync_folder(root() / robot)


def go_back(robot: str) -> str:
    """Make the release before the current one the current one, and forget the latter; Refusal if there is none."""
    past = history(robot)
    if len(past) < 2:
        raise Refusal("first", "there is no release before the current one")
    switch(robot, past[-2], past[:-2])
    return past[-2]


def history(robot: str) -> list[str]:
    """The releases that are still there, in the order in which they became current; the current one is the last."""
    try:
        told: list[str] = json.loads((root() / robot / "history").read_text(encoding="utf-8"))
    except (OSError, ValueError):  # none yet, or of a disk that lost it: what is current is known from its link
        told = []
    now, there = current(robot), set(whole_in(releases(robot)))
    past = [name for name in told if name in there]
    if now in past:
        return past[: past.index(now) + 1]
    return [*past, now] if now else past


def tidy(robots: list[str]) -> None:
    """Remove releases but the last ones and those that run, and packages that no release of any robot needs."""
    running = {robot: known["running"] for robot, known in shown(robots).items()}
    for robot in robots:
        kept = {*history(robot)[-KEPT:], running.get(robot, "")}
        for name in whole_in(releases(robot)):
            if name not in kept:
                shutil.rmtree(releases(robot) / name, ignore_errors=True)
    needed = {
        link.readlink().name
        for robot in robots_here()
        for release in whole_in(releases(robot))
        for link in (releases(robot) / release).iterdir()
        if link.is_symlink()
    }
    for name in whole_in(environment("x").parent):
        if name not in needed:
            shutil.rmtree(environment(name), ignore_errors=True)


def robots_here() -> list[str]:
    """All robots that have releases on this host, also of other fleets."""
    return [path.name for path in root().iterdir() if (path / "releases").is_dir()] if root().is_dir() else []

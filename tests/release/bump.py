"""One command gives all six distributions, their pins, the lock, CITATION.cff and the changelog the next version.

python -m tests.release.bump 0.2.0
"""

import re
import subprocess
import sys
from pathlib import Path

from packaging.version import InvalidVersion, Version

from swarmwire.comms.base.clock import WallClock
from tests.release.built import PARTS, ROOT, UV

PROJECTS = ("pyproject.toml", *(f"{part}/pyproject.toml" for part in PARTS))
OWN = re.compile(r'^version = "(.+)"$', re.MULTILINE)
CITED = re.compile(r"^version: (.+)$", re.MULTILINE)
PIN = re.compile(r'("swarmwire-[^"=]*==)[^"]+"')
UNRELEASED = "## [Unreleased]\n"


def bump(root: Path, version: str, date: str) -> None:
    """Write the version into CITATION.cff and all projects of this folder; close the changelog's section Unreleased.

    SystemExit says why not; nothing is written then.
    """
    projects = {root / name: (root / name).read_text(encoding="utf-8") for name in PROJECTS}
    changelog = (root / "CHANGELOG.md").read_text(encoding="utf-8")
    _check(version, next(iter(projects.values())), changelog)
    for path, text in projects.items():
        own = OWN.sub(f'version = "{version}"', text, count=1)
        path.write_text(PIN.sub(rf'\g<1>{version}"', own), encoding="utf-8")
    cited = (root / "CITATION.cff").read_text(encoding="utf-8")
    (root / "CITATION.cff").write_text(CITED.sub(f"version: {version}", cited), encoding="utf-8")
    closed = changelog.replace(UNRELEASED, f"{UNRELEASED}\n## [{version}] - {date}\n", 1)
    (root / "CHANGELOG.md").write_text(closed, encoding="utf-8")


def _check(version: str, project: str, changelog: str) -> None:
    match = OWN.search(project)
    before = match[1] if match else "none"
    try:
        if str(Version(version)) != version or Version(version) <= Version(before):
            raise InvalidVersion
    except InvalidVersion:
        raise SystemExit(f"{version}: expected a version after {before}, such as 0.2.0") from None
    if changelog.count(UNRELEASED) != 1:
        raise SystemExit("CHANGELOG.md: expected one section [Unreleased]")
    if not changelog.split(UNRELEASED)[1].split("\n## ", maxsplit=1)[0].strip():
        raise SystemExit("CHANGELOG.md: expected something in the section [Unreleased]")


def main(version: str) -> None:
    """Bump here, and lock anew: what others' packages the lock names stays as it is."""
    stamp = WallClock().utc_stamp()
    bump(ROOT, version, f"{stamp[:4]}-{stamp[4:6]}-{stamp[6:8]}")
    subprocess.run([UV, "lock", "--quiet"], cwd=ROOT, check=True)
    print(f"all of swarmwire is {version} now: `git diff`, then go on as docs/dev/release.md says")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    main(sys.argv[1])

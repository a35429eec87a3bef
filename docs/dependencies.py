"""The table of what each part installs and under which licences, from what is installed here."""

from collections.abc import Iterable
from importlib.metadata import distribution

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

OURS = "swarmwire"
OSI = "License :: OSI Approved :: "


def licences() -> list[tuple[str, str, str]]:
    """Who needs what under which licence: robots, everybody, and each extra, without what stands before."""
    extras = distribution(OURS).metadata.get_all("Provides-Extra") or ()
    installs = {"a robot": (f"{OURS}-agent", ""), "everything": (OURS, "")}
    installs |= {f"`[{extra}]`": (OURS, extra) for extra in sorted(extras)}
    rows: dict[tuple[int, str], set[str]] = {}
    listed: set[str] = set()
    for column, (root, extra) in enumerate(installs.values()):
        for name in sorted(_all_needed(root, extra) - listed):
            listed.add(name)
            rows.setdefault((column, licence(name)), set()).add(name)
    installers = list(installs)
    return [
        (installers[column], ", ".join(sorted(names)), dependency)
        for (column, dependency), names in sorted(rows.items())
    ]


def licence(name: str) -> str:
    """What a distribution states of its licence: an expression, else its classifiers, else a text."""
    metadata = distribution(name).metadata
    if "License-Expression" in metadata:
        return metadata["License-Expression"]
    classifiers = [text for text in metadata.get_all("Classifier") or () if text.startswith(OSI)]
    return " or ".join(text.removeprefix(OSI) for text in classifiers) or metadata["License"].splitlines()[0]


def _all_needed(root: str, extra: str) -> set[str]:
    """The distributions of others that an installation brings on this machine."""
    visited, waiting = set[tuple[str, str]](), [(root, ""), (root, extra)]
    while waiting:
        name, extra_wanted = waiting.pop()
        if (name, extra_wanted) not in visited:
            visited.add((name, extra_wanted))
            waiting += _needed(name, extra_wanted)
    return {name for name, _ in visited if not name.startswith(OURS)}


def _needed(name: str, extra: str) -> Iterable[tuple[str, str]]:
    for requirement in map(Requirement, distribution(name).requires or ()):
        if requirement.marker is None or requirement.marker.evaluate({"extra": extra}):
            dependency = canonicalize_name(requirement.name)
            yield from ((dependency, extra_wanted) for extra_wanted in ("", *requirement.extras))

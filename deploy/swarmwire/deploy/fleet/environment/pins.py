"""Which packages at which versions: what agent and drivers need, as it is installed here."""

import operator
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from importlib.metadata import Distribution, PackageNotFoundError, distribution, entry_points

from swarmwire.comms.errors import BadInput

AGENT = "swarmwire-agent"
DRIVERS = "swarmwire.drivers"  # group of entry points
REQUIREMENT = re.compile(r"(?P<name>[A-Za-z0-9][A-Za-z0-9._-]*)\s*(?:\[(?P<extras>[^\]]*)\])?[^;]*(?:;(?P<marker>.*))?")
EXTRA = re.compile(r"""extra\s*==\s*['"]([^'"]+)['"]""")
PYTHONS = re.compile(r"""python_version\s*(?P<than><|<=|>|>=|==)\s*['"](?P<major>\d+)\.(?P<minor>\d+)['"]""")
COMPARED: dict[str, Callable[[tuple[int, int], tuple[int, int]], bool]] = {
    "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge, "==": operator.eq
}  # fmt: skip
OWN = ("swarmwire-agent", "swarmwire-comms")  # these go from where they are installed, edited or not


@dataclass(frozen=True, order=True)
class Pin:
    """A package at the one version that is meant."""

    name: str
    version: str

    def __str__(self) -> str:
        """As pip takes it."""
        return f"{self.name}=={self.version}"


def pins(drivers: Iterable[str], packages: Iterable[str], python: tuple[int, int]) -> tuple[Pin, ...]:
    """The packages of an agent with these drivers, and others that it imports, with all that they need in turn.

    What is needed by some versions of Python is taken if the robot's is one of them, what is needed under any other
    condition if it is installed here. BadInput for what is not installed here.
    """
    wanted = [(AGENT, frozenset[str]()), *map(_of_driver, drivers), *((name, frozenset[str]()) for name in packages)]
    found: dict[str, Pin] = {}
    seen: set[tuple[str, frozenset[str]]] = set()
    while wanted:
        name, extras = wanted.pop()
        if (name, extras) in seen:
            continue
        seen.add((name, extras))
        try:
            there = distribution(name)
        except PackageNotFoundError:
            raise BadInput("packages", name, f"is not installed here: pip install {name}") from None
        if _plain(name) not in OWN:
            found[_plain(name)] = Pin(_plain(name), there.version)
        wanted += _needs(there, extras, python)
    return tuple(sorted(found.values()))


def _of_driver(name: str) -> tuple[str, frozenset[str]]:
    """The package that brings a driver, and its extra of the driver's name if it has one."""
    for entry in entry_points(group=DRIVERS, name=name):
        if entry.dist is not None:
            extras = entry.dist.metadata.get_all("Provides-Extra") or []
            return entry.dist.name, frozenset({name} & set(extras))
    raise BadInput("driver.name", name, "expected a driver that is installed here")


def _needs(
    there: Distribution, extras: frozenset[str], python: tuple[int, int]
) -> Iterator[tuple[str, frozenset[str]]]:
    for text in there.requires or []:
        match = REQUIREMENT.match(text)
        if match is None:
            raise BadInput("packages", there.name, f"has a requirement that cannot be read: {text}")
        marker = match["marker"] or ""
        asked = EXTRA.search(marker)
        if asked and asked[1] not in extras:
            continue
        inner = frozenset(part.strip() for part in (match["extras"] or "").split(",") if part.strip())
        if marker and not asked and not _holds(marker, python, match["name"]):
            continue
        yield match["name"], inner


def _holds(marker: str, python: tuple[int, int], name: str) -> bool:
    versions = PYTHONS.fullmatch(marker.strip())
    if versions is None:
        return _is_installed(name)
    return COMPARED[versions["than"]](python, (int(versions["major"]), int(versions["minor"])))


def _is_installed(name: str) -> bool:
    try:
        distribution(name)
    except PackageNotFoundError:
        return False
    return True


def _plain(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()

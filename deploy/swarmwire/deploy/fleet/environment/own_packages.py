"""swarmwire's own two packages for robots, as they are installed here, edited or not: they need no building."""

from collections.abc import Iterator
from importlib.metadata import distribution
from importlib.util import find_spec
from pathlib import Path

from swarmwire.comms.errors import SwarmwireError
from swarmwire.deploy.fleet.archive import Entry
from swarmwire.deploy.fleet.environment.pins import OWN

NOT_SENT = ("__pycache__",)
COMPILED = (".pyc", ".nbi", ".nbc")  # what this machine made of the sources
ABOUT = ("METADATA", "entry_points.txt")  # by which drivers are found


def own_entries() -> list[Entry]:
    """The files of both packages, and what tells of them."""
    return [entry for name in OWN for entry in _entries_of(name)]


def _entries_of(name: str) -> Iterator[Entry]:
    package = name.replace("-", ".")  # swarmwire-agent is swarmwire.agent
    spec = find_spec(package)
    if spec is None or not spec.submodule_search_locations:
        raise SwarmwireError(f"{name} is not installed here as it should be: there is no {package}")
    folder = Path(next(iter(spec.submodule_search_locations)))
    for path in sorted(folder.rglob("*")):
        inner = path.relative_to(folder)
        if path.is_file() and path.suffix not in COMPILED and not set(NOT_SENT) & set(inner.parts):
            yield Entry("/".join((*package.split("."), *inner.parts)), path.read_bytes())
    there = distribution(name)
    for about in ABOUT:
        text = there.read_text(about)
        if text is not None:
            yield Entry(f"{name.replace('-', '_')}-{there.version}.dist-info/{about}", text.encode())

"""Classes that installed packages bring, by entry points: known by name, imported where somebody asks for one."""

import sys
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import TypeVar, cast

from swarmwire.comms.errors import BadInput
from swarmwire.comms.one_of import one_of

T = TypeVar("T")


def entry_points_of(group: str) -> tuple[EntryPoint, ...]:
    """The entry points of a group, in no order. The packages are read once, and again if `sys.path` is another."""
    return _entry_points_of(group, tuple(sys.path))


@cache
def _entry_points_of(group: str, _path: tuple[str, ...]) -> tuple[EntryPoint, ...]:
    return tuple(entry_points(group=group))


def installed_points(group: str) -> dict[str, tuple[EntryPoint, ...]]:
    """The entry points of a group, by name in its order; more than one: several packages bring that name."""
    found: dict[str, tuple[EntryPoint, ...]] = {}
    for point in sorted(entry_points_of(group), key=lambda point: point.name):
        found[point.name] = (*found.get(point.name, ()), point)
    return found


def installed_class(group: str, name: str, base: type[T], what: str, where: str, key: str) -> type[T]:
    """The class below `base` of that name; `what` it is called in errors.

    BadInput at `where` and `key` says what is amiss in one line: no such name, several packages that bring it, what to
    install, or that it is no such class.
    """
    points = installed_points(group)
    if name not in points:
        raise BadInput(where, key, f"expected a {what}: {one_of(points, name)}; got {name!r}")
    if len({point.value for point in points[name]}) > 1:
        brought = ", ".join(f"{point.value} of {_package(point)}" for point in points[name])
        raise BadInput(where, key, f"expected one {what} of the name {name!r}, got {brought}")
    point = points[name][0]
    try:
        kind: object = point.load()
    except ImportError as error:
        raise BadInput(where, key, f"the {what} {name} does not import: {error}{_cure(point, error)}") from error
    except AttributeError as error:
        raise BadInput(where, key, f"the {what} {name} is not what {_package(point)} says: {error}") from error
    if not isinstance(kind, type) or not issubclass(kind, base):
        found = cast("object", kind)
        raise BadInput(where, key, f"expected a {base.__name__}, got {point.value}, which is {found!r}")
    return kind


def _package(point: EntryPoint) -> str:
    return point.dist.name if point.dist else "an unknown package"


def _cure(point: EntryPoint, error: ImportError) -> str:
    """What to install, where the package has an extra of that name."""
    extras = point.dist.metadata.get_all("Provides-Extra") or [] if point.dist else []
    missing = error.name or "" if isinstance(error, ModuleNotFoundError) else ""
    own = f"{point.module}.".startswith(f"{missing}.")  # the class's own module, which no extra brings
    if not missing or own or point.name not in extras:
        return ""
    return f": pip install '{_package(point)}[{point.name}]'"

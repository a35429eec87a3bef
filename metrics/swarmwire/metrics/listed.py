"""Which metrics a run measures: the standard ones, those that its scenario lists, and those that end its arenas."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

from swarmwire.comms.bodies.tables import built
from swarmwire.comms.errors import BadInput
from swarmwire.metrics.custom_metrics import own_kind
from swarmwire.metrics.metric import Metric
from swarmwire.metrics.plug_ins import plug_ins
from swarmwire.metrics.registry import METRICS, standard


@dataclass(frozen=True)
class Item:
    """A metric that is asked for.

    Attributes:
        key: where in the scenario its name stands, for errors: "metrics.2" or "metrics.2.metric".
        spec: a name, or a class as "package.module:Class" or "/path/file.py:Class".
        params: those given; None: the place takes none, and any metric of that name will do.
    """

    key: str
    spec: str
    params: Mapping[str, Any] | None


@dataclass(frozen=True)
class Listed:
    """What is measured, and the specs of the classes of users' and of packages' among it."""

    metrics: tuple[Metric, ...]
    code: tuple[str, ...]


def listed(items: Sequence[Item], where: str, *, with_standard: bool = True) -> Listed:
    """The standard metrics and then those of `items`, in their order; a listed standard one keeps its place.

    BadInput at an item's key for what is no metric, for parameters that do not fit, and for what is listed twice.
    """
    found = {name: METRICS[name]() for name in standard()} if with_standard else dict[str, Metric]()
    keys: dict[str, str] = {}  # by name: where it was listed
    code: list[str] = []
    for item in items:
        if item.params is None and item.spec in found:
            continue
        kind, own = _kind(item, where)
        if kind.name in keys:
            raise BadInput(where, item.key, f"{kind.name!r} is measured already, as {keys[kind.name]} lists it")
        found[kind.name] = built(kind, item.params or {}, where, item.key.removesuffix(".metric"))
        keys[kind.name] = item.key
        code += own
    return Listed(tuple(found.values()), tuple(code))


def _kind(item: Item, where: str) -> tuple[type[Metric], list[str]]:
    """The class of an item, and its spec if the class is not of swarmwire's."""
    spec = item.spec
    if item.params is not None and (":" in spec or spec.endswith(".py")):
        return own_kind(spec, where, item.key), [spec]
    if spec in METRICS:
        return METRICS[spec], []
    packaged = plug_ins()
    if spec in packaged:
        return packaged[spec].kind(where, item.key), [packaged[spec].spec]
    near = "".join(f" (did you mean {name}?)" for name in get_close_matches(spec, [*METRICS, *packaged], n=1))
    expected = "expected the name of a metric, as swarmwire list metrics tells them"
    a_class = "" if item.params is None else ", or a class as module:Class or file.py:Class"
    raise BadInput(where, item.key, f"{expected}{near}{a_class}; got {spec!r}")

"""Metrics that installed packages bring: entry points of the group `swarmwire.metrics`, a name and a class each.

Their names are read from the packages' metadata; a class is imported only where somebody asks for it.
"""

from dataclasses import dataclass
from importlib.metadata import EntryPoint

from swarmwire.comms.errors import BadInput
from swarmwire.comms.plugins import entry_points_of
from swarmwire.metrics.custom_metrics import own_kind
from swarmwire.metrics.metric import Metric

GROUP = "swarmwire.metrics"  # of entry points


@dataclass(frozen=True)
class PlugIn:
    """A metric that a package brings."""

    name: str  # as a scenario lists it
    spec: str  # its class, "package.module:Class"
    package: str  # that brings it
    twice: bool  # another package brings one of this name

    def kind(self, where: str, key: str) -> type[Metric]:
        """The class, fit to be measured; BadInput at `key` if it does not import, is no metric, or has another name."""
        if self.twice:
            raise BadInput(where, key, f"expected one plug-in {self.name!r}; more than one package brings it")
        kind = own_kind(self.spec, where, key)
        if kind.name != self.name:
            expected = f"expected {self.spec} to have the name {self.name!r} of its entry point"
            raise BadInput(where, key, f"{expected}; got {kind.name!r}")
        return kind


def plug_ins() -> dict[str, PlugIn]:
    """All there are, by name."""
    found: dict[str, PlugIn] = {}
    for point in entry_points_of(GROUP):
        found[point.name] = PlugIn(point.name, point.value.strip(), _package(point), twice=point.name in found)
    return dict(sorted(found.items()))


def _package(point: EntryPoint) -> str:
    return point.dist.name if point.dist else point.module

"""Gateways by kind: entry points of the group `swarmwire.gateways`, of which one is imported where somebody asks."""

from swarmwire.comms.plugins import installed_class, installed_points
from swarmwire.world.gateways.gateway import Gateway

GROUP = "swarmwire.gateways"  # of entry points


def gateway_names() -> list[str]:
    """The kinds of gateways that are installed."""
    return list(installed_points(GROUP))


def gateway_kind(name: str, where: str, key: str = "") -> type[Gateway]:
    """The gateway of this kind; BadInput at `where` and `key` as `installed_class`."""
    return installed_class(GROUP, name, Gateway, "gateway", where, key)

"""Fixtures that several folders of these tests share."""

from tests.support.deploy.campaign import scenario, stumbling
from tests.support.deploy.certificates import clock, folder
from tests.support.deploy.fleet.fleets import client_key, fleet, packages, robots, servers
from tests.support.deploy.gateways import scenario as two_groups
from tests.support.deploy.gateways import scripted

__all__ = [
    "client_key",
    "clock",
    "fleet",
    "folder",
    "packages",
    "robots",
    "scenario",
    "scripted",
    "servers",
    "stumbling",
    "two_groups",
]

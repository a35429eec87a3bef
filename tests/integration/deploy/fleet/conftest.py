"""Fixtures of these tests."""

from tests.support.deploy.fleet.fleets import client_key, fleet, lab_certificates, packages, robots, servers

__all__ = ["client_key", "fleet", "lab_certificates", "packages", "robots", "servers"]

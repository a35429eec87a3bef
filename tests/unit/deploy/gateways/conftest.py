"""Fixtures of these tests."""

from tests.support.deploy.gateways.fixtures import scenario, scripted

__all__ = ["scenario", "scripted"]

"""Fixtures of these tests."""

from tests.support.deploy.gateways import scenario, scripted

__all__ = ["scenario", "scripted"]

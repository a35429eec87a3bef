"""Fixtures of these tests."""

from tests.support.deploy.campaign import executors, scenario, stumbling

__all__ = ["executors", "scenario", "stumbling"]

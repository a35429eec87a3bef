"""Fixtures of these tests."""

from tests.support.deploy.campaign import here, scenario, stumbling

__all__ = ["here", "scenario", "stumbling"]

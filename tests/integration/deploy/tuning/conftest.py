"""Fixtures of these tests."""

from tests.support.deploy.tuning import calculated, here, scenario

__all__ = ["calculated", "here", "scenario"]

"""Fixtures of these tests."""

from tests.support.deploy.tuning import calculated, executors, scenario

__all__ = ["calculated", "executors", "scenario"]

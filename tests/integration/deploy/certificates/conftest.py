"""Fixtures of these tests."""

from tests.support.deploy.certificates import clock, folder

__all__ = ["clock", "folder"]

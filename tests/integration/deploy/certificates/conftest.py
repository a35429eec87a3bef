"""Fixtures of these tests."""

from tests.support.deploy.certificates.fixtures import clock, folder

__all__ = ["clock", "folder"]

"""Rigs for tests of what holds for every driver."""

from collections.abc import Iterator

import pytest

from tests.support.robots.rig import Rig
from tests.support.robots.rigs import RIGS


@pytest.fixture(params=RIGS)
def rig(request: pytest.FixtureRequest) -> Iterator[Rig]:
    """A rig of each kind; its gateway is open, and nobody connected."""
    rig = RIGS[request.param]()
    yield rig
    rig.close()


@pytest.fixture
def connected(rig: Rig) -> Rig:
    """A rig of each kind whose driver is open, with nothing that was told before."""
    rig.connect()
    rig.pop_commands()
    return rig

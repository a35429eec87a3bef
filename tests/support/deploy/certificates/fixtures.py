"""A CA in a folder, on a day that tests choose."""

from pathlib import Path

import pytest

from swarmwire.deploy.certificates.folder import begin_authority
from tests.support.deploy.certificates.dated import DatedFakeClock

TODAY = "2026-06-01T12:00:00Z"


@pytest.fixture
def clock() -> DatedFakeClock:
    return DatedFakeClock(TODAY)


@pytest.fixture
def folder(tmp_path: Path, clock: DatedFakeClock) -> Path:
    path = tmp_path / "lab" / "ca"
    begin_authority(path, clock)
    return path

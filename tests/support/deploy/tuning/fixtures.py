import pytest

from swarmwire.deploy.tuning import run
from tests.support.deploy.campaign.small import InThisProcess
from tests.support.deploy.tuning.small import Calculating, scenario_in


@pytest.fixture
def scenario(tmp_path):
    return scenario_in(tmp_path)


@pytest.fixture
def here(monkeypatch):
    """Tunings of this test need no processes: a second less for each."""
    monkeypatch.setattr(run, "open_executor", lambda *_: InThisProcess())


@pytest.fixture
def calculated(monkeypatch):
    """Tunings of this test run nothing."""
    monkeypatch.setattr(run, "open_executor", lambda *_: Calculating())

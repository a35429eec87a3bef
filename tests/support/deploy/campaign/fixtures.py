import pytest

from swarmwire.deploy.campaign import sweep as sweeping
from tests.support.deploy.campaign.small import InThisProcess, scenario_in


@pytest.fixture
def scenario(tmp_path):
    return scenario_in(tmp_path)


@pytest.fixture
def stumbling(tmp_path):
    return scenario_in(tmp_path, "stumbling.py:Stumbling")


@pytest.fixture
def here(monkeypatch):
    """Campaigns of this test need no processes: a second less for each."""
    executors: list[InThisProcess] = []

    def opened(on, workers, scenario):
        executors.append(InThisProcess())
        return executors[-1]

    monkeypatch.setattr(sweeping, "open_executor", opened)
    return executors

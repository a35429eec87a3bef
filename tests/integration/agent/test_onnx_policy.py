"""OnnxPolicy in processes: the same run, bit for bit, however the robots are spread."""

import pytest

from swarmwire.deploy import run
from tests.support.agent.policies import saved
from tests.support.deploy.runs import LOSSY

SHORT = ("duration_s=3", "robots.flock.params={}")


@pytest.fixture(scope="module")
def overrides(tmp_path_factory):
    return *SHORT, f"robots.flock.agent={saved(tmp_path_factory.mktemp('policy') / 'flock.onnx')}"


@pytest.fixture(scope="module")
def local(overrides):
    return run(LOSSY, overrides=overrides, seeds=[1, 2])


@pytest.mark.parametrize("runners", [1, 3, "per-robot"])
def test_policy_run_is_equal_in_every_layout_of_processes(overrides, local, runners):
    spread = run(LOSSY, overrides=overrides, seeds=[1, 2], runners=runners)
    assert spread.trajectory_sha256 == local.trajectory_sha256
    assert run(LOSSY, overrides=overrides, seed=2).trajectory_sha256 == local.trajectory_sha256[1:]

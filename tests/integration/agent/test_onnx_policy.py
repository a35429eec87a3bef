"""OnnxPolicy in processes: the same run, bit for bit, however the robots are spread."""

from swarmwire.deploy import run
from tests.support.agent.policies import saved
from tests.support.deploy.runs import LOSSY


def test_policy_run_is_equal_in_a_process_per_robot(tmp_path):
    overrides = "duration_s=3", "robots.flock.params={}", f"robots.flock.agent={saved(tmp_path / 'flock.onnx')}"
    local = run(LOSSY, overrides=overrides, seeds=[1, 2])
    spread = run(LOSSY, overrides=overrides, seeds=[1, 2], runners="per-robot")
    assert spread.trajectory_sha256 == local.trajectory_sha256
    assert run(LOSSY, overrides=overrides, seed=2).trajectory_sha256 == local.trajectory_sha256[1:]

"""The example that trains policies, and the policies that it made."""

from pathlib import Path

import numpy as np
import pytest

from swarmwire.agent.onnx_policy import PolicyNetwork
from swarmwire.deploy import run

LEARN = Path(__file__).parents[3] / "examples" / "learn"
POLICIES = sorted((LEARN / "policies").glob("*.onnx"))
GROUPS = {"flocking": "flock", "search": "swarm"}


@pytest.mark.parametrize("policy", POLICIES, ids=lambda path: path.stem)
def test_shipped_policies_drive_the_robots_of_their_scenario(policy: Path) -> None:
    task = policy.stem.partition("-")[0]
    group = GROUPS[task]
    overrides = [f"robots.{group}.agent={policy}", f"robots.{group}.params={{}}", "duration_s=10", 'metrics=["speed"]']
    result = run(LEARN / f"{task}.toml", overrides=overrides)
    assert (result.metrics["speed"].mean or 0.0) > 0.03
    assert result.radio.fates["received"] > 0


@pytest.mark.timeout(300)
@pytest.mark.filterwarnings("ignore::FutureWarning", "ignore::DeprecationWarning")  # of torch's exporter
@pytest.mark.parametrize("task", GROUPS)
def test_trained_network_acts_the_same_in_onnxruntime_as_in_torch(task: str, tmp_path: Path) -> None:
    torch = pytest.importorskip("torch")
    pytest.importorskip("onnxscript")
    from examples.learn.train import TASKS, exported, train

    actor, layout = train(TASKS[task], [0.0, 0.9], seed=1, updates=1)
    numbers = len(layout.observation)
    observations = np.sin(np.arange(1000 * numbers) * 0.7).reshape(1000, numbers).astype(np.float32)
    with torch.no_grad():
        expected = actor(torch.from_numpy(observations)).numpy()
    actions = PolicyNetwork(exported(actor, numbers), "here")(observations)
    assert np.abs(actions - expected).max() < 1e-5

"""OnnxPolicy: a trained policy's file as an agent, in runs of one process, and what is refused."""

import hashlib
import json
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from swarmwire.agent import onnx_policy
from swarmwire.agent.agent import NoAgent, agent_sha256, load_agent
from swarmwire.agent.onnx_policy import METADATA, ROWS, PolicyNetwork, save_policy
from swarmwire.agent.policy_io import PolicyIO, PolicyLayout
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.deploy import Recording, Simulation, repeat
from swarmwire.deploy.learn import vector_env
from swarmwire.deploy.runs.config import RunConfig
from swarmwire.deploy.runs.plan import make_plan
from tests.support.agent.policies import FLOCKING, network, result, saved
from tests.support.refusals import refused_input

SCENARIO = Path(__file__).parents[3] / "scenarios" / "flocking.toml"
SIZES = (7, 16, 3)
OBSERVATION = np.sin(np.arange(40 * 7) * 0.3).reshape(40, 7).astype(np.float32)
SHORT = ("duration_s=2", "robots.flock.params={}")


@pytest.fixture(scope="module")
def trained() -> bytes:
    """A policy's file."""
    with TemporaryDirectory() as folder:
        return saved(Path(folder) / "flock.onnx").read_bytes()


@pytest.fixture
def policy(tmp_path: Path, trained: bytes) -> Path:
    path = tmp_path / "flock.onnx"
    path.write_bytes(trained)
    return path


def of_agent(path: Path) -> tuple[str, ...]:
    return *SHORT, f"robots.flock.agent={path}"


def test_network_output_equals_its_formula() -> None:
    action = PolicyNetwork(network(SIZES), "here")(OBSERVATION)
    np.testing.assert_allclose(action, result(OBSERVATION, SIZES), atol=1e-5)
    assert action.dtype == np.float32


def test_row_has_the_same_action_alone_and_among_others() -> None:
    of_blocks = PolicyNetwork(network(SIZES), "here")
    assert of_blocks.rows == ROWS
    together = of_blocks(OBSERVATION)
    for first, last in ((0, 1), (5, 9), (13, 40)):
        assert np.array_equal(of_blocks(OBSERVATION[first:last]), together[first:last])


@pytest.mark.parametrize("kind", ["ReduceMean over robots", "one row"])
def test_network_without_separate_rows_is_called_per_robot(kind: str) -> None:
    last = helper.make_node("Softmax", ["end"], ["action"], axis=0) if kind != "one row" else None
    alone = PolicyNetwork(network(SIZES, 1 if kind == "one row" else "rows", last), "here")
    assert alone.rows == 1
    expected = result(OBSERVATION, SIZES) if last is None else np.ones((40, 3))  # the only one has all of the softmax
    np.testing.assert_allclose(alone(OBSERVATION), expected, atol=1e-5)


def test_run_with_a_policy_equals_the_episode_of_its_network_and_is_repeated_from_its_folder(
    policy: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    with Simulation(SCENARIO, seed=3, overrides=of_agent(policy), out=folder, record=Recording(rrd=False)) as run:
        run.run()
    envs = vector_env(SCENARIO, arenas=1, seed=3, neighbours=FLOCKING.neighbours, overrides=SHORT)
    network_of_file = PolicyNetwork(policy.read_bytes(), "here")
    observations, _ = envs.reset()
    for _ in range(20):
        observations, *_ = envs.step(network_of_file(observations[0])[None])
    assert list(envs.trajectory_sha256) == run.hashes()
    sha256 = hashlib.sha256(policy.read_bytes()).hexdigest()
    facts = json.loads((folder / "run.json").read_text())
    assert {"path": "files/flock.onnx", "sha256": sha256, "what": "agent"} in facts["files"]
    assert "onnxruntime" in facts["modules"]
    assert agent_sha256(load_agent(str(policy))) == sha256
    policy.unlink()
    assert repeat(folder).same


def test_policy_file_with_other_contents_is_another_agent(policy: Path) -> None:
    first = load_agent(str(policy))
    assert load_agent(str(policy)) is first
    saved(policy, io=PolicyIO(sensors=("compass",)))
    assert load_agent(str(policy)).needs == ("compass",)
    assert first.needs == FLOCKING.needs


@pytest.mark.parametrize(
    ("body", "radio", "fault"),
    [
        ("epuck2", "{}", "flock.onnx needs 'radio.range', which the radio does not measure"),
        ("footbot", "{range={}, bearing={}}", "flock.onnx was trained for another body than epuck: number 8 of 50 of "),
    ],
)
def test_policy_outside_its_training_is_refused_in_one_line(tmp_path: Path, body: str, radio: str, fault: str) -> None:
    path = saved(tmp_path / "flock.onnx", body)
    with refused_input(key="robots.flock.agent", match=fault):
        make_plan(RunConfig(SCENARIO, overrides=(*of_agent(path), f"radio.measures={radio}")))


def test_malformed_policy_files_are_refused(tmp_path: Path) -> None:
    path, plain = tmp_path / "flock.onnx", network(SIZES)
    layout = PolicyLayout(FLOCKING, load_body("epuck"))

    def described(about: object) -> bytes:
        model = onnx.load_model_from_string(plain)
        helper.set_model_props(model, {METADATA: about if isinstance(about, str) else json.dumps(about)})
        return model.SerializeToString()

    about = {"format": 1, "io": {}, "observation": ["one"], "action": ["two", "three"]}
    cases = {
        "onnxruntime does not load it": b"no model",
        "has no description of its observations": plain,
        "expected JSON": described("{"),
        "format: expected 1, got 2": described({"format": 2}),
        "io: is missing": described({"format": 1}),
        "neighbours: expected 0 to 64, got 65": described({**about, "io": {"neighbours": 65}}),
        r"expected a network of 1 numbers to 2, got \(7, 3\)": described(about),
    }
    for fault, data in cases.items():
        path.write_bytes(data)
        with pytest.raises(NoAgent, match=fault):
            load_agent(str(path))
    path.unlink()
    with pytest.raises(NoAgent, match="expected a readable file: No such file"):
        load_agent(str(path))
    with pytest.raises(BadInput, match=rf"expected a network of {len(layout.observation)} numbers to 4"):
        save_policy(path, plain, layout)
    assert not path.exists()


def test_weights_outside_the_file_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model = onnx.load_model_from_string(network((2, 2)))
    weights = model.graph.initializer[0]
    (tmp_path / "weights.bin").write_bytes(weights.raw_data)
    weights.ClearField("raw_data")
    weights.data_location = TensorProto.EXTERNAL
    weights.external_data.add(key="location", value="weights.bin")
    monkeypatch.chdir(tmp_path)  # where onnxruntime looks by default
    with pytest.raises(BadInput, match=r"here: onnxruntime does not load it: .*weights.bin"):
        PolicyNetwork(model.SerializeToString(), "here")


def test_network_that_does_not_run_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    at, *ends = (
        helper.make_tensor_value_info(name, kind, shape)
        for name, kind, shape in (
            ("at", TensorProto.INT64, []),
            *((f"on{end}", TensorProto.BOOL, []) for end in ("", "2")),
            *((f"value{end}", TensorProto.FLOAT, None) for end in ("", "2")),
        )
    )
    steps = [helper.make_node("Identity", [name], [f"{name}2"]) for name in ("on", "value")]
    endless = helper.make_graph(steps, "endless", [at, *ends[::2]], ends[1::2])
    monkeypatch.setattr(onnx_policy, "TRIAL_S", 0.2)
    cases = {
        "no action within 0.2 s": helper.make_node("Loop", ["", "", "end"], ["action"], body=endless),
        r"expected an output of 16 x 3, got shape \(1, 3\)": helper.make_node("Gather", ["end", "first"], ["action"]),
        "Non-zero status code": helper.make_node("Reshape", ["end", "shape"], ["action"]),
    }
    first = numpy_helper.from_array(np.array([0]), "first")
    shape = numpy_helper.from_array(np.array([-1, 5]), "shape")  # 16 x 3 numbers are no rows of 5
    for fault, last in cases.items():
        model = onnx.load_model_from_string(network(SIZES, last=last))
        model.graph.initializer.extend([first, shape])
        model.graph.output[0].type.tensor_type.shape.dim[0].dim_param = "others"
        with pytest.raises(BadInput, match=rf"here: expected a network that runs: .*{fault}") as refused:
            PolicyNetwork(model.SerializeToString(), "here").try_out()
        assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("kind", "shape", "fault"),
    [
        (TensorProto.DOUBLE, ("rows", 2), "expected one input, float32"),
        (TensorProto.FLOAT, (4, 2), "a fixed number of numbers; got 4 x 2"),
        (TensorProto.FLOAT, ("rows", "numbers"), "a fixed number of numbers; got rows x numbers"),
    ],
)
def test_network_of_another_type_or_shape_is_refused(kind: int, shape: tuple[str | int, ...], fault: str) -> None:
    ends = [helper.make_tensor_value_info(end, kind, shape) for end in ("observation", "action")]
    graph = helper.make_graph([helper.make_node("Identity", ["observation"], ["action"])], "g", ends[:1], ends[1:])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    with pytest.raises(BadInput, match=fault):
        PolicyNetwork(model.SerializeToString(), "here")


def test_missing_onnxruntime_names_its_install_command(policy: Path, monkeypatch) -> None:
    monkeypatch.setattr("swarmwire.comms.base.extras.find_spec", lambda _: None)
    moved = policy.rename(policy.with_name("other.onnx"))
    with pytest.raises(NoAgent, match=r"needs onnxruntime: install swarmwire-agent\[policy\]"):
        load_agent(str(moved))

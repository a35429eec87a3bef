"""What environments take and return: seeds, masks, actions, flags, infos, spaces."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from swarmwire.comms.base.config import read_toml
from swarmwire.deploy.learn import Choice, parallel_env, vector_env

FLOCKING = Path(__file__).parents[3] / "scenarios" / "flocking.toml"
SHORT = ("duration_s=0.2", "robots.flock.count=3")
MASK = np.array([True, False, False])


def _vector(**options: Any) -> Any:
    return vector_env(FLOCKING, 3, overrides=SHORT, **options)


# The values of masks and seeds are those of Gymnasium 1.4's SyncVectorEnv.reset.
def test_reset_mask_seeds_its_arenas_alone() -> None:
    envs = _vector(autoreset="disabled")
    envs.reset(seed=[10, 20, 30])
    expected = envs.reset()[1]["seed"]
    envs.reset(seed=[10, 20, 30])
    _, infos = envs.reset(seed=[11, 99, 98], options={"reset_mask": MASK})
    assert infos["seed"][0] == 11
    _, infos = envs.reset(options={"reset_mask": [False, True, True]})
    assert infos["seed"][1:].tolist() == expected[1:].tolist()
    assert infos["_seed"].tolist() == [False, True, True]


def test_seeds_of_none_continue_the_sequence_of_their_arenas() -> None:
    envs = _vector()
    envs.reset(seed=5)
    later = envs.reset()[1]["seed"].tolist()
    envs.reset(seed=np.array([5, 6, 7]))
    assert envs.reset(seed=[1, None, None])[1]["seed"].tolist() == [1, *later[1:]]


@pytest.mark.parametrize("mask", [[1], [True], True, [[True, True, True]], [1, 0, 0], [False] * 3, None])
def test_reset_mask_that_cannot_be_raises_value_error_and_changes_nothing(mask: Any) -> None:
    envs = _vector(seed=1)
    envs.reset()
    with pytest.raises(ValueError, match="reset_mask"):
        envs.reset(seed=7, options={"reset_mask": mask})
    assert envs.arenas.seeds.tolist() == [1, 2, 3]
    assert (envs.reset()[1]["seed"] > 10).all()


@pytest.mark.parametrize("seed", [-1, [1, 2], [1, 2, -3], [1, 2, 2.5], 2**63 - 1])
def test_seeds_that_cannot_be_raise_value_error(seed: Any) -> None:
    with pytest.raises(ValueError, match="seed"):
        _vector().reset(seed=seed)


def test_flags_with_autoreset_disabled_are_copies() -> None:
    envs = _vector(autoreset="disabled")
    envs.reset()
    still = np.zeros(envs.action_space.shape, np.float32)
    envs.step(still)
    _, _, terminated, truncated, _ = envs.step(still)
    assert truncated.all()
    terminated[:], truncated[:] = True, False
    envs.reset(options={"reset_mask": MASK})
    _, _, terminated, truncated, _ = envs.step(still)
    assert not terminated.any()
    assert truncated.tolist() == [False, True, True]


def test_observations_with_groups_of_unlike_length_are_copies() -> None:
    table = read_toml(FLOCKING)
    table["robots"]["flock"]["count"] = 2
    table["robots"]["others"] = {"body": "footbot", "count": 2, "agent": "swarmwire.agent.behaviours:Diffusion"}
    written, unwritten = (vector_env(table, 1) for _ in range(2))
    observations = [envs.reset()[0] for envs in (written, unwritten)]
    still = np.zeros(written.action_space.shape, np.float32)
    observations[0][:] = 7.0
    np.testing.assert_array_equal(written.step(still)[0], unwritten.step(still)[0])


@pytest.mark.parametrize(
    ("change", "agent"),
    [
        ({"flock-1": np.zeros(1, np.float32)}, "flock-1"),
        ({"flock-1": np.zeros(5, np.float32)}, "flock-1"),
        ({"flock-1": np.zeros((4, 1), np.float32)}, "flock-1"),
        ({"flock-1": np.float32(1.0)}, "flock-1"),
        ({"flock-2": np.array([0.0, np.nan, 0.0, 0.0])}, "flock-2"),
        ({"flock-9": np.zeros(4, np.float32)}, "flock-9"),
        ({"flock-0": None}, "flock-0"),
    ],
)
def test_actions_that_an_agent_cannot_take_raise_value_error_with_its_name(change: dict[str, Any], agent: str) -> None:
    env = parallel_env(FLOCKING, overrides=SHORT)
    env.reset()
    actions = {name: np.zeros(4, np.float32) for name in env.agents} | change
    with pytest.raises(ValueError, match=agent):
        env.step({name: action for name, action in actions.items() if action is not None})
    env.step({name: np.zeros(4, np.float32) for name in env.agents})


def test_actions_that_are_not_finite_are_refused_before_an_arena_begins() -> None:
    envs = _vector(seed=1)
    envs.reset()
    still = np.zeros(envs.action_space.shape, np.float32)
    for _ in range(2):
        envs.step(still)
    with pytest.raises(ValueError, match="flock-2"):
        envs.step(np.where(np.arange(3)[:, None] == 2, np.inf, still))
    assert envs.arenas.seeds.tolist() == [1, 2, 3]


def test_state_is_in_its_space() -> None:
    env = parallel_env(FLOCKING, overrides=SHORT)
    env.reset()
    assert env.state_space.contains(env.state())
    assert env.state_space.shape == (3, 7)


def test_infos_are_numbers_alone() -> None:
    agent = "swarmwire.agent.behaviours:Flocking"
    randomise = {"radio.loss": Choice([0, 0.25]), "robots.flock.agent": Choice([agent])}
    envs = _vector(randomise=randomise, seed=1)
    _, infos = envs.reset(seed=range(3))
    for _ in range(2):
        *_, last = envs.step(np.zeros(envs.action_space.shape, np.float32))
        infos |= last
    assert infos["radio.loss"].tolist() == [values["radio.loss"] for values in envs.arenas.values]
    assert "episode_seed" in infos
    assert {value.dtype.kind for value in infos.values()} <= set("biuf")
    one = parallel_env(FLOCKING, overrides=SHORT, randomise=randomise)
    assert one.reset()[1]["flock-0"].keys() == {"seed", "radio.loss"}
    assert one.arenas.values[0]["robots.flock.agent"] == agent

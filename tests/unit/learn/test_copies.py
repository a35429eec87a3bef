"""Copies of environments: deep copies and pickles, new and in the midst of episodes."""

import copy
import pickle  # noqa: TID251 - tools copy environments by it
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cloudpickle
import pytest
from gymnasium.utils.env_checker import data_equivalence

from swarmwire.deploy.learn import ArenaState, Choice, parallel_env, vector_env
from tests.unit.learn.scripted_agent import rule

FLOCKING = Path(__file__).parents[3] / "scenarios" / "flocking.toml"
SHORT = ("duration_s=0.8", "robots.flock.count=3")
Copy = Callable[[Any], Any]
COPIES: dict[str, Copy] = {
    "pickle": lambda env: pickle.loads(pickle.dumps(env)),
    "cloudpickle": lambda env: cloudpickle.loads(cloudpickle.dumps(env)),
    "deepcopy": copy.deepcopy,
}


def right_side(state: ArenaState) -> Any:
    """The arenas whose first robot is at x > 0 after 0.3 s; they end at various times."""
    return (state.pose[:, 0, 0] > 0.0) & (state.time_s > 0.25)


def _episode(env: Any, observations: dict[str, Any], steps: int) -> list[Any]:
    results: list[Any] = []
    for _ in range(steps):
        results.append(env.step({agent: rule(observations[agent]) for agent in env.agents}))
        observations = results[-1][0]
    return results


@pytest.mark.parametrize("copied", COPIES.values(), ids=COPIES)
def test_parallel_env_copies_run_the_same_episodes_from_where_it_is(copied: Copy) -> None:
    env = parallel_env(FLOCKING, overrides=SHORT, reward="order", randomise={"radio.loss": Choice([0.0, 0.5])})
    new = copied(env)
    begun = env.reset()
    assert data_equivalence(new.reset(), begun)
    after_reset = copied(env)
    first = _episode(env, begun[0], 3)
    midst = copied(env)
    last = _episode(env, first[-1][0], 5)
    assert data_equivalence(_episode(after_reset, begun[0], 8), first + last)
    assert data_equivalence(_episode(midst, first[-1][0], 5), last)
    over = copied(env)
    assert env.agents == over.agents == []
    digests = {each.trajectory_sha256 for each in (env, after_reset, midst, over)}
    assert len(digests) == 1
    assert len(digests.pop()) == 64
    again = env.reset()
    assert again[1]["flock-0"]["seed"] != begun[1]["flock-0"]["seed"]
    assert all(data_equivalence(each.reset(), again) for each in (after_reset, midst, over))


@pytest.mark.parametrize("mode", ["next_step", "same_step", "disabled"])
def test_vector_env_copies_continue_arenas_of_various_ages(mode: Any) -> None:
    randomise = {"radio.loss": Choice([0.0, 0.5])}
    envs = vector_env(FLOCKING, 4, overrides=SHORT, autoreset=mode, terminated=right_side, randomise=randomise, seed=3)
    observations, _ = envs.reset()
    terminated: Any = None
    for _ in range(4):
        observations, _, terminated, _, _ = envs.step(rule(observations))
    if mode == "disabled":
        observations, _ = envs.reset(options={"reset_mask": terminated})
    assert envs.arenas.worlds > 1
    twin = pickle.loads(pickle.dumps(envs))
    for _ in range(4):
        result = envs.step(rule(observations))
        assert data_equivalence(twin.step(rule(observations)), result)
        observations = result[0]
    assert any(envs.trajectory_sha256)
    assert twin.trajectory_sha256 == envs.trajectory_sha256


def test_pickle_names_a_reward_that_has_no_name_in_a_module() -> None:
    env = parallel_env(FLOCKING, overrides=SHORT, reward=lambda state: state.time_s)
    with pytest.raises((AttributeError, pickle.PicklingError), match="lambda"):
        pickle.dumps(env)
    assert cloudpickle.loads(cloudpickle.dumps(env)).reset()[0].keys() == env.reset()[0].keys()

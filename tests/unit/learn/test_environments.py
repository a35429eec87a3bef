"""`swarmwire.deploy.learn`: episodes are ordinary runs, as PettingZoo and Gymnasium expect."""

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import RecordEpisodeStatistics
from pettingzoo.test import parallel_api_test

from swarmwire.comms.base.config import read_toml
from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy import Simulation
from swarmwire.deploy.learn import ArenaState, Choice, Condition, Uniform, parallel_env, vector_env
from tests.support.agent.policies import FLOCKING as POLICY
from tests.support.refusals import refused_input
from tests.unit.learn.scripted_agent import rule

ROOT = Path(__file__).parents[3]
FLOCKING = ROOT / "scenarios" / "flocking.toml"
AGENT = f"robots.flock.agent={Path(__file__).parent / 'scripted_agent.py'}:Scripted"
SHORT = ("duration_s=2", "robots.flock.count=6")


def _hashes(seeds: list[int], *overrides: str) -> list[str]:
    """The trajectory hashes of ordinary runs of the rule as an agent, on their own."""
    hashes: list[str] = []
    for seed in seeds:
        with Simulation(FLOCKING, seed=seed, overrides=[*SHORT, AGENT, "robots.flock.params={}", *overrides]) as run:
            run.run()
        hashes += run.hashes()
    return hashes


def _environment(**options: Any) -> Any:
    overrides = (*SHORT, *options.pop("overrides", ()))
    return vector_env(FLOCKING, neighbours=POLICY.neighbours, overrides=overrides, **options)


def _still(env: Any) -> dict[str, Any]:
    """Actions of 0 for all agents."""
    return {agent: np.zeros(4, np.float32) for agent in env.possible_agents}


def test_episode_equals_the_run_of_its_seed_with_the_same_actions() -> None:
    envs = _environment(arenas=3, seed=4)
    observations, _ = envs.reset()
    for _ in range(19):
        observations, _, terminated, truncated, _ = envs.step(rule(observations))
        assert not (terminated | truncated).any()
    _, _, _, truncated, infos = envs.step(rule(observations))
    assert truncated.all()
    assert infos["episode_seed"].tolist() == [4, 5, 6]
    assert list(envs.trajectory_sha256) == _hashes([4, 5, 6])


def test_arenas_that_begin_alone_stay_ordinary_runs_and_so_do_the_others() -> None:
    def terminated(state: ArenaState) -> Any:
        return (state.time_s > 0.65) & (np.arange(len(state.time_s)) == 1)

    for mode in ("next_step", "same_step"):
        envs = _environment(arenas=3, seed=4, autoreset=mode, terminated=terminated)
        observations, _ = envs.reset()
        ended: list[tuple[int, int, str]] = []
        for step in range(20):
            observations, _, over, truncated, infos = envs.step(rule(observations))
            facts = infos.get("final_info", infos)
            now = np.flatnonzero(over | truncated)
            ended += [(step, facts["episode_seed"][arena], envs.trajectory_sha256[arena]) for arena in now]
            assert np.flatnonzero(over).tolist() in ([], [1])
        last = [(seed, digest) for step, seed, digest in ended if step == 19]
        early = [(seed, digest) for step, seed, digest in ended if step < 19]
        assert [seed for seed, _ in last] == [4, 6]
        assert [digest for _, digest in last] == _hashes([4, 6])
        assert early[0][0] == 5
        assert len(early) == 2
        assert [digest for _, digest in early] == _hashes([seed for seed, _ in early], "duration_s=0.7")


def test_randomised_values_of_an_episode_are_drawn_from_its_seed() -> None:
    randomise = {
        "radio.loss": Choice([0.0, 0.9]),
        "robots.flock.body_overrides.sensors.proximity.drop_out": Uniform(0.0, 0.5),
    }
    envs = _environment(arenas=4, seed=1, randomise=randomise)
    observations, infos = envs.reset()
    values = [{path: infos[path][arena] for path in randomise} for arena in range(4)]
    assert {value["radio.loss"] for value in values} == {0.0, 0.9}
    for _ in range(20):
        observations, *_ = envs.step(rule(observations))
    for arena, value in enumerate(values):
        overrides = [f"{path}={number}" for path, number in value.items()]
        assert [envs.trajectory_sha256[arena]] == _hashes([arena + 1], *overrides)
    _, again = envs.reset(seed=1)
    assert [{path: again[path][arena] for path in randomise} for arena in range(4)] == values
    _, later = envs.reset()
    assert [{path: later[path][arena] for path in randomise} for arena in range(4)] != values


def test_without_hashes_the_episodes_are_the_same() -> None:
    pairs = [_environment(arenas=2, hashes=hashes, overrides=["duration_s=0.5"]) for hashes in (True, False)]
    steps: list[Any] = [envs.reset(seed=2) for envs in pairs]
    for _ in range(5):
        np.testing.assert_array_equal(steps[0][0], steps[1][0])
        action = rule(steps[0][0])
        steps = [envs.step(action) for envs in pairs]
    assert [all(envs.trajectory_sha256) for envs in pairs] == [True, False]
    assert steps[0][4]["episode_seed"].tolist() == steps[1][4]["episode_seed"].tolist() == [2, 3]


def test_parallel_env_passes_pettingzoos_tests() -> None:
    env, twin = (parallel_env(FLOCKING, overrides=SHORT, reward="order") for _ in range(2))
    parallel_api_test(env, 30)
    # PettingZoo 1.27's parallel_seed_test ends after a step: `any(terminations1)` is true of names.
    for _ in range(2):
        assert data_equivalence(env.reset(seed=42), twin.reset(seed=42))
        for agent in env.agents:
            env.action_space(agent).seed(42)
        steps = 0
        while env.agents:
            actions = {agent: env.action_space(agent).sample() for agent in env.agents}
            assert data_equivalence(env.step(actions), twin.step(actions))
            steps += 1
        assert steps == 20
        assert env.trajectory_sha256 == twin.trajectory_sha256


class _Single(gymnasium.Env[Any, Any]):
    """A vector environment of one arena as a plain environment."""

    def __init__(self) -> None:
        self._envs = _environment(arenas=1, reward="order")
        self.observation_space = self._envs.single_observation_space
        self.action_space = self._envs.single_action_space

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        super().reset(seed=seed)
        observations, infos = self._envs.reset(seed=seed)
        return observations[0], infos

    def step(self, action: Any) -> Any:
        observations, reward, terminated, truncated, infos = self._envs.step(action[None])
        return observations[0], float(reward[0]), bool(terminated[0]), bool(truncated[0]), infos


@pytest.mark.filterwarnings("ignore::UserWarning")  # of what is advised: one row of numbers, finite bounds
def test_gymnasium_check_passes_for_one_arena() -> None:
    check_env(_Single(), skip_render_check=True)


def test_without_autoreset_an_arena_waits_for_its_reset() -> None:
    def terminated(state: ArenaState) -> Any:
        return (state.time_s > 0.25) & (np.arange(len(state.time_s)) == 1)

    envs = _environment(
        arenas=3, seed=4, autoreset="disabled", terminated=terminated, reward=lambda state: np.ones(len(state.time_s))
    )
    assert envs.metadata["autoreset_mode"] == AutoresetMode.DISABLED
    observations, _ = envs.reset()
    for step in range(20):
        observations, reward, over, truncated, infos = envs.step(rule(observations))
        waits = step > 2
        assert reward.tolist() == [1.0, 0.0 if waits else 1.0, 1.0]
        assert over.tolist() == [False, step >= 2, False]
        assert truncated.tolist() == [step == 19, False, step == 19]
        assert observations[1].any() != waits
        if step in (2, 19):
            ended = infos["_episode_seed"]
            assert ended.tolist() == ([False, True, False] if step == 2 else [True, False, True])
            expected = _hashes([5], "duration_s=0.3") if step == 2 else _hashes([4, 6])
            assert np.array(envs.trajectory_sha256)[ended].tolist() == expected
    with pytest.raises(RuntimeError, match="reset"):
        envs.step(rule(observations))
    observations, _ = envs.reset(options={"reset_mask": np.array([True, True, False])})
    _, reward, over, truncated, _ = envs.step(rule(observations))
    assert reward.tolist() == [1.0, 1.0, 0.0]
    assert truncated.tolist() == [False, False, True]
    assert envs.arenas.worlds == 1


@pytest.mark.parametrize("mode", ["next_step", "same_step"])
def test_vector_env_is_one_of_gymnasiums(mode: Any) -> None:
    envs = _environment(arenas=3, reward=lambda state: np.ones(len(state.time_s)), autoreset=mode)
    assert envs.metadata["autoreset_mode"] == AutoresetMode({"next_step": "NextStep", "same_step": "SameStep"}[mode])
    recorded = RecordEpisodeStatistics(envs)
    observations, _ = recorded.reset(seed=3)
    recorded.action_space.seed(3)
    for _ in range(45):
        assert recorded.observation_space.contains(observations)
        observations, reward, terminated, truncated, infos = recorded.step(recorded.action_space.sample())
        assert (reward.shape, reward.dtype) == ((3,), np.float64)
        assert (terminated.dtype, truncated.dtype) == (np.bool_, np.bool_)
        if truncated.any():
            assert infos["episode"]["r"].tolist() == [20.0, 20.0, 20.0]
            assert ("final_obs" in infos) == (mode == "same_step")
    recorded.close()


def test_rewards_are_weighted_metrics_or_a_number_per_robot() -> None:
    envs = _environment(arenas=2, reward={"order": 2.0, "wall_contacts": -1.0})
    observations, _ = envs.reset()
    with Simulation(FLOCKING, seeds="1:3", overrides=[*SHORT, AGENT, "robots.flock.params={}"]) as run:
        for _ in range(10):
            before = run.metrics.latest.get("wall_contacts", np.zeros(2))
            run.step()
            latest = run.metrics.latest
            observations, reward, *_ = envs.step(rule(observations))
            np.testing.assert_array_equal(
                reward, 2.0 * latest["order"] - (latest["wall_contacts"] - np.nan_to_num(before))
            )

    each = parallel_env(FLOCKING, overrides=SHORT, reward=lambda state: state.pose[:, :, 0])
    each.reset()
    _, rewards, *_ = each.step(_still(each))
    assert [*rewards.values()] == pytest.approx(each.state()[:, 0].tolist(), rel=1e-6)


def test_conditions_end_an_episode() -> None:
    envs = _environment(arenas=2, terminated=Condition("order", "at_least", 0.0, hold_s=0.3))
    envs.reset()
    ends = [envs.step(envs.action_space.sample())[2].tolist() for _ in range(4)]
    assert ends == [[False, False]] * 3 + [[True, True]]


def test_other_groups_run_their_agents() -> None:
    table = read_toml(FLOCKING)
    table["duration_s"] = 1.0
    table["robots"]["others"] = {"body": "footbot", "count": 3, "agent": "swarmwire.agent.behaviours:Diffusion"}
    state: list[ArenaState] = []
    envs = vector_env(table, arenas=2, groups=["flock"], reward=lambda now: state.append(now) or np.zeros(2))
    observations, _ = envs.reset()
    count = table["robots"]["flock"]["count"]
    assert observations.shape[1] == count
    for _ in range(5):
        envs.step(np.zeros_like(envs.action_space.sample()))
    assert (state[-1].command[:, :count] == 0.0).all()
    assert (state[-1].command[:, count:, 0] > 0.0).all()

    both = vector_env(table, arenas=2)
    observations, _ = both.reset()
    assert observations.shape[1] == count + 3


@pytest.mark.parametrize(
    "path",
    sorted([*ROOT.glob("scenarios/*.toml"), *ROOT.glob("scenarios/behaviours/*.toml")]),
    ids=lambda path: path.stem,
)
def test_shipped_scenarios_are_environments(path: Path) -> None:
    env = parallel_env(path)
    observations, _ = env.reset()
    for _ in range(2):
        assert all(env.observation_space(agent).contains(observations[agent]) for agent in env.agents)
        observations, *_ = env.step({agent: env.action_space(agent).sample() for agent in env.agents})


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"arenas": 0}, "arenas: expected 1 to 10000"),
        ({"groups": ["birds"]}, "groups: expected some of flock"),
        ({"groups": []}, "groups: expected one or more of flock"),
        ({"sensors": ["sonar"]}, "has no 'sonar'"),
        ({"reward": "odrer"}, "did you mean order"),
        ({"randomise": {"robots.flock.count": Choice([3, 4])}}, "expected keys that keep robots"),
        ({"randomise": {"radio.loss": Uniform(0.0, 2.0)}}, "radio.loss"),
        ({"randomise": {"radio.loss": 0.5}}, "expected a Uniform or a Choice"),
        ({"autoreset": "never"}, "autoreset: expected one of next_step"),
        ({"reward": lambda _: np.zeros(7)}, "reward: expected an array"),
        ({"terminated": lambda _: np.zeros((9, 6))}, "terminated: expected an array"),
    ],
)
def test_environment_options_that_cannot_be_are_refused_in_one_line(options: dict[str, Any], words: str) -> None:
    def used() -> None:
        envs = _environment(**{"arenas": 9, **options})
        envs.reset()
        envs.step(envs.action_space.sample())

    with refused_input(match=words):
        used()


def test_values_that_were_refused_are_refused_again() -> None:
    envs = _environment(arenas=2, randomise={"robots.flock.count": Choice([4])})
    for _ in range(2):
        with pytest.raises(BadInput, match="expected keys that keep robots"):
            envs.reset()


def test_actions_of_another_shape_are_refused() -> None:
    envs = _environment(arenas=2)
    envs.reset()
    with pytest.raises(BadInput, match=r"actions: expected an array \(2, 6, 4\), got \(2, 6, 1\)"):
        envs.step(np.zeros((2, 6, 1)))


def test_without_an_episode_a_step_asks_for_a_reset() -> None:
    envs = _environment(arenas=2)
    with pytest.raises(RuntimeError, match="reset"):
        envs.step(envs.action_space.sample())
    one = parallel_env(FLOCKING, overrides=["duration_s=0.1"])
    with pytest.raises(RuntimeError, match="reset"):
        one.step({})
    one.reset()
    *_, truncated, _ = one.step(_still(one))
    assert all(truncated.values())
    with pytest.raises(RuntimeError, match="reset"):
        one.step({})


def test_arenas_that_begin_alone_report_the_values_that_they_drew() -> None:
    envs = _environment(arenas=2, randomise={"radio.loss": Choice([0.5])})
    _, infos = envs.reset(options={"reset_mask": np.array([False, True])})
    assert infos["radio.loss"][1] == 0.5
    assert infos["_radio.loss"].tolist() == [False, True]

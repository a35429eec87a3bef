"""Law 2: the same scenario and seed give the same run bit for bit, however robots are split, over encoded frames."""

from functools import partial
from pathlib import Path

import pytest

from swarmwire.deploy import Result, backends, run
from tests.support.deploy.commands import LOSSY, ROOT
from tests.support.encoded_backend import EncodedBackend

SHORT = ["duration_s=1.5"]
SCENARIOS = sorted(
    path
    for folder in (".", "behaviours", "papers/scenarios", "robots")
    for path in (ROOT / "scenarios" / folder).glob("*.toml")
    if path.stem != "turtlebot"  # a body that lies among them
)


@pytest.fixture(scope="module")
def local() -> Result:
    return run(LOSSY, overrides=SHORT)


def encoded(monkeypatch: pytest.MonkeyPatch, scenario: Path, **given) -> Result:
    """A run through frames, with its robots in three parts, unless `given` says otherwise."""
    seeds = given.pop("seeds", None)
    overrides = given.pop("overrides", SHORT)
    with monkeypatch.context() as patched:
        patched.setattr(backends, "LocalBackend", partial(EncodedBackend, **given))
        result = run(scenario, overrides=overrides, seeds=seeds)
    assert not any(name.endswith("_frames") for name in result.counts), result.counts
    return result


@pytest.mark.parametrize("scenario", SCENARIOS, ids=lambda path: path.stem)
def test_every_shipped_scenario_runs_alike_through_frames(monkeypatch, scenario):
    through_frames = encoded(monkeypatch, scenario)
    directly = run(scenario, overrides=SHORT)
    assert through_frames.trajectory_sha256 == directly.trajectory_sha256
    assert [arena.radio for arena in through_frames.arenas] == [arena.radio for arena in directly.arenas]


@pytest.mark.parametrize("split", [{"runners": 1}, {"runners": 1000}, {"backwards": True}], ids=str)
def test_into_how_many_parts_robots_are_split_and_who_gets_which_does_not_matter(monkeypatch, local, split):
    result = encoded(monkeypatch, LOSSY, **split)
    assert result.trajectory_sha256 == local.trajectory_sha256
    assert (result.radio, result.metrics) == (local.radio, local.metrics)


def test_a_users_agent_of_the_same_rule_gives_the_same_run(local):
    mine = f"robots.flock.agent={ROOT / 'examples' / 'flocking_agent.py'}:MyFlocking"
    assert run(LOSSY, overrides=[*SHORT, mine]).trajectory_sha256 == local.trajectory_sha256


@pytest.mark.parametrize("through_frames", [False, True])
def test_an_arena_is_the_same_alone_and_as_one_of_eight(monkeypatch, local, through_frames):
    seeds = range(1, 9)
    eight = encoded(monkeypatch, LOSSY, seeds=seeds) if through_frames else run(LOSSY, overrides=SHORT, seeds=seeds)
    assert eight.trajectory_sha256[0] == local.trajectory_sha256[0]
    assert eight.trajectory_sha256[4] == run(LOSSY, overrides=SHORT, seed=5).trajectory_sha256[0]
    assert (eight.arenas[0].radio, eight.arenas[0].metrics) == (local.radio, local.metrics)
    assert len(set(eight.trajectory_sha256)) == 8


def test_another_seed_or_another_loss_is_another_run(local):
    assert run(LOSSY, overrides=SHORT, seed=2).trajectory_sha256 != local.trajectory_sha256
    assert run(LOSSY, overrides=[*SHORT, "radio.loss=0.31"]).trajectory_sha256 != local.trajectory_sha256
